// SPDX-License-Identifier: MIT
// Which diagonals the quads of a patch's grid take: the nearer ones (kernels/quad_diagonal.h). Where both
// are equally near to 1e-6, the library, which computes in single precision, may take the other one.
import {cross, dot, norm} from '../vector.js';

/** Weights of the rows -1 to 2 at 1/2 of a cubic, which goes on straight where there is no row. */
const rowWeights = (hasBefore, hasAfter) => [
  hasBefore ? -0.0625 : 0, 0.5625 - (hasBefore ? 0 : 0.125) + (hasAfter ? 0 : 0.0625),
  0.5625 - (hasAfter ? 0 : 0.125) + (hasBefore ? 0 : 0.0625), hasAfter ? -0.0625 : 0
];
const COLUMN_WEIGHTS = rowWeights(true, true);

/** Whether the second diagonal of a quad is nearer. @param {number[][]} at where points begin, row by row of the 4 x 4 around */
function takesSecond(points, at, weights) {
  const [v00, v01] = [at[1][1], at[1][2]], [v10, v11] = [at[2][1], at[2][2]];
  const first = [0, 0, 0], second = [0, 0, 0], away = [[0, 0, 0], [0, 0, 0]];
  let size = 0;
  for (let axis = 0; axis < 3; ++axis) {
    let centre = 0;
    for (let r = 0; r < 4; ++r)
      for (let c = 0; c < 4; ++c) centre += weights[r] * COLUMN_WEIGHTS[c] * points[at[r][c] + axis];
    size += Math.abs(centre);
    first[axis] = points[v11 + axis] - points[v00 + axis];
    second[axis] = points[v10 + axis] - points[v01 + axis];
    away[0][axis] = 0.5 * (points[v00 + axis] + points[v11 + axis]) - centre;
    away[1][axis] = 0.5 * (points[v01 + axis] + points[v10 + axis]) - centre;
  }
  const normal = cross(first, second), length = Math.max(norm(normal), 1e-18);
  const [distance, other] = away.map((offset) => Math.abs(dot(offset, normal)) / length);
  const squared = dot(first, first), blur = 3e-7 * size + 1e-4 * Math.sqrt(squared);
  return (other + blur) * dot(second, second) < (distance + 0.9 * blur) * squared;
}

/** One bit per quad between inner rows, patch by patch, row by row. */
export class Diagonals {
  /** @param {number[][]} patches rectangles of the texture */
  constructor(patches) {
    const count = patches.reduce((sum, [, , width, height]) => sum + width * (height - 3), 0);
    this.bits = new Uint8Array(Math.ceil(count / 8));
    this.quad = 0;
  }

  /** Adds those of the next patch. @param {Float64Array} points three numbers each, row by row */
  add(points, width, height) {
    for (let row = 1; row < height - 2; ++row) {
      const hasBefore = row > 1, hasAfter = row < height - 3, weights = rowWeights(hasBefore, hasAfter);
      const begins = [row - (hasBefore ? 1 : 0), row, row + 1, row + (hasAfter ? 2 : 1)].map((r) => r * width);
      for (let column = 0; column < width; ++column, ++this.quad) {
        const at = begins.map((begin) => [-1, 0, 1, 2].map((step) => 3 * (begin + (column + step + width) % width)));
        if (takesSecond(points, at, weights)) this.bits[this.quad >> 3] |= 1 << (this.quad & 7);
      }
    }
  }
}
