// SPDX-License-Identifier: MIT
// The numbers of a compact model, from the payload of its file (docs/compact.md, core/skeletex/compact/compact_file.h).
// The library has checked the file before it wrote the page.

/**
 * @typedef {{normal: Int32Array, side: Int32Array?, across: Int32Array?}} Step residuals of the points that a step adds
 * @typedef {{columns: number, intervals: number, stepCount: number, baseExponent: number, rowSteps: number,
 *     knots: number[], *     base: Int32Array, poles: number[][], steps: Step[]}} CompactPatch
 * @typedef {{node: number, bones: number[], corners: number[], stepCount: number, base: number[], steps: Step[]}} CompactArc
 * @typedef {{step: number, weights: number[][], patches: CompactPatch[], arcs: CompactArc[],
 *     corners: {node: number, bone: number, turn: number, distance: number}[]}} Compact
 */

const REVERSED = Uint8Array.from({length: 256}, (_, byte) => {
  let result = 0;
  for (let bit = 0; bit < 8; ++bit) result |= ((byte >> bit) & 1) << (7 - bit);
  return result;
});
const signed = (symbol) => (symbol % 2 ? -(symbol + 1) / 2 : symbol / 2);

class Reader {
  /** @param {Uint8Array} bytes */
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }
  byte() { return this.bytes[this.at++]; }
  skip(count) { this.at += count; }
  count() {
    let value = 0;
    for (let factor = 1;; factor *= 128) {
      const byte = this.byte();
      value += (byte & 127) * factor;
      if (byte < 128) return value;
    }
  }
  number() { return signed(this.count()); }
  residual() {
    const byte = this.byte();
    return signed(byte === 255 ? 255 + this.count() : REVERSED[byte]);
  }
  real() {
    const value = new DataView(this.bytes.buffer, this.bytes.byteOffset + this.at, 8).getFloat64(0, true);
    this.skip(8);
    return value;
  }
  numbers(count) { return Array.from({length: count}, () => this.number()); }
  residuals(count) {
    const values = new Int32Array(count);
    for (let i = 0; i < count; ++i) values[i] = this.residual();
    return values;
  }
  get isAtEnd() { return this.at >= this.bytes.length; }
  each(read) { return Array.from({length: this.count()}, read); }
}

/** Passes over what the page has as JSON: names, places and axes. */
function skipSkeleton(reader) {
  const skipTexts = (count) => { for (let i = 0; i < count; ++i) reader.skip(reader.count()); };
  reader.number();
  reader.skip(3);
  reader.numbers(3);
  const nodes = reader.count();
  skipTexts(nodes);
  reader.numbers(3 * nodes);
  const bones = reader.count();
  skipTexts(bones);
  for (let i = 0; i < bones; ++i) {
    reader.count();
    reader.count();
    reader.skip(2);
  }
  if (reader.byte() === 255) reader.skip(6 * 8);
}

function readStep(reader, count, hasAcross) {
  const isTangential = reader.byte() === 1, normal = reader.residuals(count);
  const side = isTangential ? reader.residuals(count) : null;
  return {normal, side, across: isTangential && hasAcross ? reader.residuals(count) : null};
}

/** Whether a step doubles rows; beyond the file's own, rows and columns take turns. */
export function doublesRows(patch, step) {
  return step < patch.stepCount ? ((patch.rowSteps >>> step) & 1) === 1 : (step - patch.stepCount) % 2 === 0;
}

/** How many points a step adds inside a patch. */
function siteCount(patch, step) {
  let {columns, intervals} = patch;
  for (let i = 0; i < step; ++i)
    if (doublesRows(patch, i)) intervals *= 2;
    else columns *= 2;
  return (doublesRows(patch, step) ? intervals : intervals - 1) * columns;
}

/** Residuals of a coarse grid: each value less what the left, upper and upper left one foretell. */
function readBase(reader, patch) {
  const row = 3 * patch.columns, base = new Int32Array((patch.intervals - 1) * row);
  for (let k = 0; k < 3; ++k)
    for (let i = k; i < base.length; i += 3) {
      const hasLeft = i % row >= 3, hasAbove = i >= row;
      const left = hasLeft ? base[i - 3] : 0, above = hasAbove ? base[i - row] : 0;
      base[i] = reader.residual() + (hasLeft && hasAbove ? left + above - base[i - row - 3] : left + above);
    }
  return base;
}

function readPatch(reader) {
  const [columns, intervals, stepCount, baseExponent] = Array.from({length: 4}, () => reader.byte());
  const rowSteps = reader.count();
  const knots = [reader.byte(), reader.byte(), reader.byte()].map((x) => x / 256);
  return {columns, intervals, stepCount, baseExponent, rowSteps, knots, base: new Int32Array(0), poles: [[], []], steps: []};
}

/**
 * @param {Uint8Array} payload without layers; steps of the finer levels may be missing
 * @param {import('../skeleton.js').SeparationPlanes} planes
 * @returns {Compact}
 */
export function readCompact(payload, planes) {
  const reader = new Reader(payload);
  skipSkeleton(reader);
  const step = reader.real(), bareLevels = reader.byte();
  const weights = [0, 1].map(() => [0, 1, 2, 3].map(() => reader.byte() - 128));
  const corners = reader.each(() => {
    const node = reader.count(), bones = reader.each(() => reader.count());
    return {node, bone: bones[0], turn: (reader.byte() + 256 * reader.byte()) / 65536, distance: reader.count() * step};
  });
  const arcs = reader.each(() => {
    const node = reader.count(), bones = [reader.count(), reader.count()];
    const ends = [reader.count() - 1, reader.count() - 1], stepCount = reader.byte();
    return {node, bones, corners: ends, stepCount, base: [], steps: Array(reader.byte())};
  });
  const patches = planes.skeleton.bones.map(() => readPatch(reader));
  if (reader.count() !== 0) throw new Error('the compact model has layers');
  patches.forEach((patch, bone) => {
    for (const end of [0, 1]) if (planes.isFree(bone, end)) patch.poles[end] = reader.numbers(3);
  });
  for (const arc of arcs) {
    const isClosed = arc.corners[0] < 0;
    if (isClosed) arc.base = reader.numbers(8);
    for (let i = 0; i < arc.steps.length; ++i) arc.steps[i] = readStep(reader, (isClosed ? 4 : 1) << i, false);
  }
  for (const patch of patches) patch.base = readBase(reader, patch);
  const most = Math.max(...patches.map((patch) => patch.stepCount));
  for (let level = most - 1; level >= bareLevels && !reader.isAtEnd; --level)
    for (const patch of patches) {
      const number = patch.stepCount - 1 - level;
      if (number >= 0) patch.steps.push(readStep(reader, siteCount(patch, number), true));
    }
  return {step, weights, patches, arcs, corners};
}
