// SPDX-License-Identifier: MIT
// The lattice of one level and one stage: vertices, triangles, and where both lie in the texture. It has more vertices than
// the library's: around each end it repeats the seam's vertices, or the pole once per column, so that each has one column in
// the texture. These copies follow the inner vertices, bone by bone, head before tail.
import {array, unpackSteps} from './data.js';

/**
 * @typedef {object} Lattice
 * @property {number} innerCount
 * @property {number} vertexCount with the copies around the ends
 * @property {Int32Array} places four numbers per vertex: bone, row, column, and the number of a seam's point or -1
 * @property {number[]} sources per copy, its vertex in the library's mesh, counted from the inner ones on
 * @property {Float32Array} columns per vertex, in texels of its patch; not wrapped
 * @property {Int32Array} patches per vertex, the bone whose patch it lies in; seams have one copy in each
 * @property {Uint32Array} triangles three vertices each; the last one is an inner vertex
 * @property {Int32Array} rings see surface.glsl
 */

function addQuads(level, diagonals, triangles) {
  let vertex = 0, quad = 0, at = 0;
  for (const [, , width, height] of level.patches) {
    for (let row = 0; row < height - 3; ++row)
      for (let j = 0; j < width; ++j, ++quad) {
        const a = vertex + row * width + j, b = vertex + row * width + (j + 1 < width ? j + 1 : 0);
        const c = a + width, d = b + width;
        const isSecond = (diagonals[quad >> 3] >> (quad & 7)) & 1;
        triangles.set(isSecond ? [a, b, c, c, b, d] : [a, b, d, a, d, c], at);
        at += 6;
      }
    vertex += width * (height - 2);
  }
  return at;
}

/** Rings of the vertices behind the inner ones: the other two corners of the triangles around, and of poles eight. */
function makeRings(innerCount, copies, poleCount, sources, endTriangles) {
  const around = new Map();
  for (let t = 0; t < endTriangles.length; t += 3)
    for (let k = 0; k < 3; ++k) {
      const vertex = endTriangles[t + k];
      if (vertex < innerCount) continue;
      const source = sources[vertex - innerCount];
      if (!around.has(source)) around.set(source, []);
      around.get(source).push([endTriangles[t + (k + 1) % 3], endTriangles[t + (k + 2) % 3]]);
    }
  const begin = new Map(), pairs = [];
  around.forEach((ring, source) => {
    let kept = ring;
    if (source < poleCount && ring.length > 8) {
      const step = ring.length / 8, corners = Array.from({length: 8}, (_, i) => ring[Math.floor(i * step)][0]);
      const isForward = ring[0][1] === ring[1][0];
      kept = corners.map((corner, i) => (isForward ? [corner, corners[(i + 1) % 8]] : [corners[(i + 1) % 8], corner]));
    }
    begin.set(source, [copies + pairs.length, copies + pairs.length + kept.length]);
    pairs.push(...kept);
  });
  const rings = new Int32Array(4 * (copies + pairs.length));
  for (let i = 0; i < copies; ++i) rings.set(begin.get(sources[i]) ?? [0, 0], 4 * i);
  pairs.forEach((pair, i) => rings.set(pair, 4 * (copies + i)));
  return rings;
}

/** Per end its vertices, counted from the first pole on: of a pole once per column, of a seam those of its ring. */
function endVertices(level, stage, poleCount) {
  const firstOfArc = [];
  let next = poleCount, pole = 0;
  for (const {samples} of stage.arcs) {
    firstOfArc.push(next);
    next += samples;
  }
  return stage.ends.flatMap((ends, bone) => ends.map((uses) => {
    if (uses.length === 0) return Array(level.patches[bone][2]).fill(pole++);
    return uses.flatMap(([arc, isReversed]) => {
      const {samples, corners} = stage.arcs[arc], first = firstOfArc[arc];
      const inner = Array.from({length: samples}, (_, i) => first + (isReversed ? samples - 1 - i : i));
      return corners[0] < 0 ? inner : [next + corners[isReversed ? 1 : 0], ...inner];
    });
  }));
}

/** The triangles of a strip between a ring of copies and a row of `width` vertices, or of the fan around a pole. */
function addStrip({isHead, isPole, copy, count, row, width, start}, isSeamStep, triangles) {
  let [k, j] = start;
  for (let step = 0; step < (isPole ? width : width + count); ++step) {
    const here = row + (j % width), apex = copy + ((isPole ? j : k) % count);
    if (!isPole && isSeamStep()) {
      const next = copy + (++k % count);
      triangles.push(...(isHead ? [apex, next] : [next, apex]), here);
    } else {
      const next = row + (++j % width);
      triangles.push(...(isHead ? [here, apex, next] : [next, apex, here]));
    }
  }
}

function endTrianglesOf(level, stage, ends, innerCount, arrays) {
  const steps = array(arrays, stage.strips), triangles = [];
  let step = 0, copy = innerCount, first = 0;
  const isSeamStep = () => (steps[step >> 3] >> (step++ & 7)) & 1;
  ends.forEach((vertices, end) => {
    const bone = end >> 1, isHead = end % 2 === 0, [, , width, height] = level.patches[bone];
    const strip = {
      isHead, isPole: stage.ends[bone][end % 2].length === 0, copy, count: vertices.length,
      row: first + (isHead ? 0 : (height - 3) * width), width, start: stage.starts[end]
    };
    addStrip(strip, isSeamStep, triangles);
    copy += vertices.length;
    if (!isHead) first += width * (height - 2);
  });
  return triangles;
}

/** The columns of the copies: steps from one to the next, and of poles the middles of the columns. */
function endColumns(stage, ends, arrays) {
  const steps = unpackSteps(arrays, stage.columns).values, columns = [];
  let next = 0;
  ends.forEach((vertices, end) => {
    const isPole = stage.ends[end >> 1][end % 2].length === 0;
    let column = 0;
    for (let i = 0; i < vertices.length; ++i) columns.push(isPole ? i + 0.5 : column += steps[next++]);
  });
  return columns;
}

/**
 * @param {any} stage with `diagonals`, one bit per quad: it takes the second diagonal
 * @returns {Lattice}
 */
export function makeLattice(arrays, level, stage, bonesOfSeams) {
  const {poleCount} = bonesOfSeams, ends = endVertices(level, stage, poleCount), sources = ends.flat();
  const innerCount = level.patches.reduce((sum, [, , width, height]) => sum + width * (height - 2), 0);
  const vertexCount = innerCount + sources.length;
  const places = new Int32Array(4 * vertexCount), columns = new Float32Array(vertexCount), patches = new Int32Array(vertexCount);
  let vertex = 0;
  level.patches.forEach(([, , width, height], bone) => {
    for (let row = 1; row < height - 1; ++row)
      for (let column = 0; column < width; ++column, ++vertex) {
        places.set([bone, row, column, -1], 4 * vertex);
        columns[vertex] = column;
        patches[vertex] = bone;
      }
  });
  ends.forEach((vertices, end) => {
    const bone = end >> 1, row = end & 1 ? level.patches[bone][3] - 1 : 0;
    for (const source of vertices) {
      const isPole = source < poleCount;
      places.set(isPole ? [bone, row, 0, -1] : [bonesOfSeams.bones[source - poleCount], row, 0, source - poleCount], 4 * vertex);
      patches[vertex++] = bone;
    }
  });
  columns.set(endColumns(stage, ends, arrays), innerCount);
  const endTriangles = endTrianglesOf(level, stage, ends, innerCount, arrays);
  const quads = level.patches.reduce((sum, [, , width, height]) => sum + width * (height - 3), 0);
  const triangles = new Uint32Array(6 * quads + endTriangles.length);
  triangles.set(endTriangles, addQuads(level, stage.diagonals, triangles));
  return {
    innerCount, vertexCount, places, sources, columns, patches, triangles,
    rings: makeRings(innerCount, sources.length, poleCount, sources, endTriangles)
  };
}
