// SPDX-License-Identifier: MIT
// The texels of a morph: both models' texels, each read at a place of its own, and moved onto the seams. What
// kernels/blend.cl does; tables between two keys are interpolated.
import {axialOf, interval} from './skeleton.js';

const END_RANGE = 0.3;
const eased = (x) => x * x * (3 - 2 * x);

/** Numbers between those of two keys. */
const between = (a, b, share) => (share === 0 ? a : a.map((x, i) => x + share * (b[i] - x)));

/** A column rounded to a whole one when it is as near as the accuracy of seams. */
const rounded = (column) => (Math.abs(column - Math.round(column)) < 1e-3 ? Math.round(column) : column);

/** Values around a bone, convolved with a Gaussian of a twentieth of a turn. */
function smoothedAround(values) {
  const count = values.length, width = 0.05 * count, radius = Math.min((count - 1) >> 1, Math.ceil(3 * width));
  const shares = Float64Array.from({length: 2 * radius + 1}, (_, k) => Math.exp(-0.5 * ((k - radius) / width) ** 2));
  const total = shares.reduce((sum, share) => sum + share, 0);
  return Float64Array.from({length: count}, (_, j) => {
    let sum = 0;
    for (let k = -radius; k <= radius; ++k) sum += shares[k + radius] * values[(j + k + count) % count];
    return sum / total;
  });
}

/**
 * Where the columns of a patch are read in a source, at head and tail, and how far the slopes of the result's planes lie
 * above the source's there; each also smoothed around the bone.
 */
function columnTables(a, b, share, begin, width, [, , period, , sign], sourceSlopes, slopes) {
  return [0, 1].map((end) => {
    const columns = new Float64Array(width), offsets = new Float64Array(width), rises = new Float64Array(width);
    for (let j = 0; j < width; ++j) {
      const k = 2 * (begin + j), turn = period * Math.round((b[k] - a[k]) / period);  // the short way round
      columns[j] = rounded(a[k + end] + share * (b[k + end] - turn - a[k + end]));
      offsets[j] = columns[j] / period - sign * j / width;
      const left = Math.floor(columns[j]), right_share = columns[j] - left;
      const slopeOf = (column) => sourceSlopes[2 * (column - period * Math.floor(column / period)) + end];
      rises[j] = slopes[end][j] - (1 - right_share) * slopeOf(left) - right_share * slopeOf(left + 1);
    }
    const even = smoothedAround(offsets).map((offset, j) => rounded(period * (offset + sign * j / width)));
    return {columns, even, rises, evenRises: smoothedAround(rises)};
  });
}

/**
 * @param {any} level with `blend` unpacked
 * @param {import('./skeleton.js').SeparationPlanes} planes of the skeleton at t
 * @param {ArrayLike<number>} rows at t
 * @param {number} t
 * @returns {Float32Array} texels in the first model's layout, four floats each
 */
export function blendedTexels(level, planes, rows, t) {
  const {blend, patches} = level, {i, next, share} = interval(blend.keys, t), a = blend.keys[i], b = blend.keys[next];
  const moves = between(a.moves, b.moves, share);
  const texels = new Float32Array(4 * level.width * level.height);
  const columnCount = patches.reduce((sum, [, , width]) => sum + width, 0);
  let firstColumn = 0, firstRow = 0;
  patches.forEach(([x, y, width, height], bone) => {
    const slopes = [0, 1].map((end) => Float32Array.from({length: width}, (_, j) => planes.slope(bone, end, j / width)));
    const tables = [0, 1].map((source) => {
      const index = source * patches.length + bone;
      return columnTables(a.columns, b.columns, share, source * columnCount + firstColumn, width, blend.sources[index], blend.sourceSlopes[index], slopes);
    });
    for (let row = 0; row < height; ++row) {
      const u = rows[firstRow + row], {axial} = axialOf(u, planes.isFree(bone, 0), planes.isFree(bone, 1));
      const out = 4 * ((y + row) * level.width + x);
      [1 - t, t].forEach((weight, source) => {
        if (weight > 0) addSource(texels, out, source, weight, bone, row, axial, slopes, tables[source]);
      });
      moveEnds(texels, out, u, firstColumn, width);
    }
    firstColumn += width;
    firstRow += height;
  });
  return texels;

  function addSource(sum, out, source, weight, bone, row, axial, slopes, [atHead, atTail]) {
    const index = source * patches.length + bone, [x, y, period, rowCount, sign] = blend.sources[index];
    const [, , width, height] = patches[bone], {values, width: stride} = source === 0 ? level : level.second;
    const share_of_rows = row * (rowCount - 1) / (height - 1), at_row = sign < 0 ? rowCount - 1 - share_of_rows : share_of_rows;
    const below = Math.min(Math.max(Math.floor(at_row), 0), rowCount - 2), above = at_row - below;
    const ease = eased(axial), near_head = Math.max(0, 1 - axial / END_RANGE), near_tail = Math.max(0, 1 - (1 - axial) / END_RANGE);
    const head = (1 - ease) * eased(near_head), even_head = 1 - ease - head, tail = ease * eased(near_tail), even_tail = ease - tail;
    const ownSlopes = blend.sourceSlopes[index];
    for (let j = 0; j < width; ++j) {
      const lifted = head * atHead.columns[j] + even_head * atHead.even[j] + tail * atTail.columns[j] + even_tail * atTail.even[j];
      const column = lifted - period * Math.floor(lifted / period), left = Math.min(Math.floor(column), period - 1);
      const right_share = column - left, right = left + 1 < period ? left + 1 : 0;
      const p = 4 * ((y + below) * stride + x + left), q = 4 * ((y + below) * stride + x + right), up = 4 * stride;
      const w00 = weight * (1 - above) * (1 - right_share), w01 = weight * (1 - above) * right_share;
      const w10 = weight * above * (1 - right_share), w11 = weight * above * right_share;
      const along = sign * (w00 * values[p] + w01 * values[q] + w10 * values[p + up] + w11 * values[q + up]);
      const around = sign * (w00 * values[p + 1] + w01 * values[q + 1] + w10 * values[p + up + 1] + w11 * values[q + up + 1]);
      const outwards = w00 * values[p + 2] + w01 * values[q + 2] + w10 * values[p + up + 2] + w11 * values[q + up + 2];
      // From the source's frame, of slope own, to the result's.
      const slope = slopes[0][j] + axial * (slopes[1][j] - slopes[0][j]);
      const own_head = ownSlopes[2 * left] + right_share * (ownSlopes[2 * right] - ownSlopes[2 * left]);
      const own_tail = ownSlopes[2 * left + 1] + right_share * (ownSlopes[2 * right + 1] - ownSlopes[2 * left + 1]);
      const own = own_head + axial * (own_tail - own_head) + head * atHead.rises[j] + even_head * atHead.evenRises[j] +
          tail * atTail.rises[j] + even_tail * atTail.evenRises[j];
      const square = 1 + slope * slope, inverse = 1 / Math.sqrt(square * (1 + own * own));
      const isTurned = Math.abs(own - slope) > 1e-5 * square;
      const cosine = isTurned ? (1 + slope * own) * inverse : 1, sine = isTurned ? (own - slope) * inverse : 0;
      sum[out + 4 * j] += cosine * along + sine * outwards;
      sum[out + 4 * j + 1] += around;
      sum[out + 4 * j + 2] += cosine * outwards - sine * along;
    }
  }

  function moveEnds(sum, out, u, first, width) {
    const at_head = eased(Math.max(0, 1 - u / END_RANGE)), at_tail = eased(Math.max(0, 1 - (1 - u) / END_RANGE));
    for (let j = 0; j < width; ++j)
      for (let k = 0; k < 3; ++k)
        sum[out + 4 * j + k] += at_head * moves[k * columnCount + first + j] + at_tail * moves[(3 + k) * columnCount + first + j];
  }
}
