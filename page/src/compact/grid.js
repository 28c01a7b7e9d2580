// SPDX-License-Identifier: MIT
// The grids of points of a compact model's patches, refined step by step (core/skeletex/compact/refine.h and
// patch_grid.h). Points are three numbers each, row by row; rows 0 and `intervals` lie on a seam or all in a pole.
import {add, cross, mix, scaled} from '../vector.js';
import {doublesRows} from './file.js';
import {endRow, halfwayWeights} from './seams.js';

/** @typedef {{intervals: number, columns: number, hasPole: boolean[], points: Float64Array}} Grid */

/** Where a point begins. A row beyond a pole is that on its other side. */
function place({intervals, columns}, row, column) {
  if (row < 0 || row > intervals) {
    row = row < 0 ? -row : 2 * intervals - row;
    column += Math.floor(columns / 2);
  }
  return 3 * (row * columns + (((column % columns) + columns) % columns));
}

/** The points that a step adds, as predicted: where they go, and their frames. */
class Sites {
  /** @param {number} count */
  constructor(count) {
    this.count = count;
    this.places = new Int32Array(count);  // in the refined grid
    for (const name of ['predicted', 'normal', 'side']) this[name] = new Float64Array(3 * count);
    this.spacing = new Float64Array(count);
    this.width = new Float64Array(count);
  }

  /** Frame of a site, from the differences between the points along and across the refined direction. */
  setFrame(i, [x, y, z], [a, b, c]) {
    const {normal, side} = this, spacing = Math.sqrt(x * x + y * y + z * z);
    this.spacing[i] = spacing;
    this.width[i] = 0.25 * Math.sqrt(a * a + b * b + c * c);
    const set = (to, u, v, w) => {
      const length = Math.sqrt(u * u + v * v + w * w);
      if (length > 0) to.set([u / length, v / length, w / length], 3 * i);
      return length > 0;
    };
    if (!set(side, x, y, z)) side[3 * i] = 1;
    if (set(normal, y * c - z * b, z * a - x * c, x * b - y * a)) return;
    const s = side.subarray(3 * i, 3 * i + 3), axis = Math.abs(s[0]) < 0.5 ? [1, 0, 0] : [0, 1, 0];
    set(normal, ...cross(s, axis));
  }

  meanSpacing() { return this.spacing.reduce((sum, x) => sum + x, 0) / Math.max(1, this.count); }
}

/** How many rows beyond an end a prediction may read. */
const rowsBeyond = ({hasPole, columns, intervals}, end) =>
  hasPole[end] && columns % 2 === 0 ? Math.min(2, intervals - 1) : 0;

const difference = (points, a, b) => [points[a] - points[b], points[a + 1] - points[b + 1], points[a + 2] - points[b + 2]];

function predict(grid, weights, placeOf, to, at) {
  for (let k = 0; k < weights.length; ++k) {
    const p = placeOf(k);
    for (let axis = 0; axis < 3; ++axis) to[at + axis] += weights[k] * grid.points[p + axis];
  }
}

/** The difference a + b - c - d of four points. */
function spread(points, a, b, c, d) {
  return [0, 1, 2].map((k) => points[a + k] + points[b + k] - (points[c + k] + points[d + k]));
}

function rowSites(grid) {
  const {intervals, columns, points} = grid, sites = new Sites(intervals * columns);
  for (let r = 0, i = 0; r < intervals; ++r) {
    const before = Math.min(3, r + 1 + rowsBeyond(grid, 0)), after = Math.min(3, intervals - r + rowsBeyond(grid, 1));
    const weights = halfwayWeights(before, after);
    for (let c = 0; c < columns; ++c, ++i) {
      sites.places[i] = 3 * ((2 * r + 1) * columns + c);
      predict(grid, weights, (k) => place(grid, r + 1 - before + k, c), sites.predicted, 3 * i);
      sites.setFrame(i, difference(points, place(grid, r + 1, c), place(grid, r, c)),
                     spread(points, place(grid, r, c + 1), place(grid, r + 1, c + 1), place(grid, r, c - 1), place(grid, r + 1, c - 1)));
    }
  }
  return sites;
}

/** By how much each new point of an end's row differs from its prediction along the row. */
function endMisses(grid, row, fine) {
  const misses = new Float64Array(3 * grid.columns), weights = halfwayWeights(3, 3).map((x) => -x);
  for (let c = 0; c < grid.columns; ++c) {
    misses.set(fine.subarray(6 * c + 3, 6 * c + 6), 3 * c);
    predict(grid, weights, (k) => place(grid, row, c - 2 + k), misses, 3 * c);
  }
  return misses;
}

function columnSites(grid, ends) {
  const {intervals, columns, points} = grid, sites = new Sites((intervals - 1) * columns), weights = halfwayWeights(3, 3);
  const misses = [endMisses(grid, 0, ends[0]), endMisses(grid, intervals, ends[1])];
  for (let r = 1, i = 0; r < intervals; ++r)
    for (let c = 0; c < columns; ++c, ++i) {
      sites.places[i] = 3 * (r * 2 * columns + 2 * c + 1);
      predict(grid, weights, (k) => place(grid, r, c - 2 + k), sites.predicted, 3 * i);
      const a = place(grid, r, c), b = place(grid, r, c + 1);
      sites.setFrame(i, difference(points, b, a),
                     spread(points, place(grid, r + 1, c), place(grid, r + 1, c + 1), place(grid, r - 1, c), place(grid, r - 1, c + 1)));
      const squared = sites.spacing[i] ** 2;
      for (const end of [0, 1]) {
        if (grid.hasPole[end] || squared === 0) continue;
        const row = end === 0 ? 0 : intervals;
        const [x, y, z] = spread(points, a, b, place(grid, row, c), place(grid, row, c + 1));
        const share = squared / (squared + 10 * 0.25 * (x * x + y * y + z * z));
        for (let k = 0; k < 3; ++k) sites.predicted[3 * i + k] += share * misses[end][3 * c + k];
      }
    }
  return sites;
}

/** The prediction of a site's offset from the left, upper, upper left and upper right one in its step. */
function expectedOffset(weights, offsets, i, columns) {
  const column = i % columns, above = i - columns;
  let sum = column > 0 ? weights[0] * offsets[i - 1] : 0;
  if (above >= 0)
    sum += weights[1] * offsets[above] + weights[2] * offsets[column > 0 ? above - 1 : above + columns - 1] +
        weights[3] * offsets[column + 1 < columns ? above + 1 : above + 1 - columns];
  return Math.trunc(sum / 64);
}

/** Moves the sites of a step from where they are predicted. */
function moveSites(sites, columns, residuals, number, step, weights) {
  const {predicted, normal, side} = sites, q = number >= 4 ? step : 0.6 * step;
  const offsets = new Float64Array(sites.count), mean = sites.meanSpacing();
  for (let i = 0; i < sites.count; ++i) {
    offsets[i] = 64 * residuals.normal[i] + expectedOffset(weights, offsets, i, columns);
    const out = q / 64 * offsets[i];
    const tangential = number < 2 ? Math.max(0.05 * mean, 4 * q)
      : Math.min(16 * q, Math.max(q / 4, 0.25 * Math.min(sites.spacing[i], sites.width[i])));
    const n = normal.subarray(3 * i, 3 * i + 3), s = side.subarray(3 * i, 3 * i + 3);
    const along = residuals.side ? tangential * residuals.side[i] : 0, beside = residuals.side ? tangential * residuals.across[i] : 0;
    const across = beside === 0 ? [0, 0, 0] : cross(n, s);
    for (let k = 0; k < 3; ++k) predicted[3 * i + k] += out * n[k] + along * s[k] + beside * across[k];
  }
}

/** The grid with the points of a step between its own. */
function refined(grid, isRows, ends, sites) {
  const {intervals, columns, points} = grid, fine = isRows ? {intervals: 2 * intervals, columns} : {intervals, columns: 2 * columns};
  const all = new Float64Array(3 * (fine.intervals + 1) * fine.columns);
  for (let r = 0; r <= intervals; ++r)
    for (let c = 0; c < columns; ++c) {
      const from = 3 * (r * columns + c), to = isRows ? 3 * (2 * r * columns + c) : 3 * (2 * r * columns + 2 * c);
      for (let k = 0; k < 3; ++k) all[to + k] = points[from + k];
    }
  if (!isRows) {
    all.set(ends[0], 0);
    all.set(ends[1], all.length - ends[1].length);
  }
  for (let i = 0; i < sites.count; ++i)
    for (let k = 0; k < 3; ++k) all[sites.places[i] + k] = sites.predicted[3 * i + k];
  return {...fine, hasPole: grid.hasPole, points: all};
}

/** The coarse grid of a patch: its ends, and inner points beside the lines between them. */
function coarseGrid(compact, planes, bone, ends) {
  const patch = compact.patches[bone], {columns, intervals} = patch, {o} = planes.bases[bone];
  const points = new Float64Array(3 * (intervals + 1) * columns), [head, tail] = ends.map((end) => endRow(end, columns));
  points.set(head, 0);
  points.set(tail, points.length - tail.length);
  const tangential = compact.step * 2 ** patch.baseExponent, steps = [0.6 * compact.step, tangential, tangential];
  for (let row = 1; row < intervals; ++row)
    for (let column = 0; column < columns; ++column) {
      const radial = planes.radial(bone, column / columns), at = 3 * ((row - 1) * columns + column);
      let point = mix([...head.subarray(3 * column, 3 * column + 3)], tail.subarray(3 * column, 3 * column + 3), row / intervals);
      [radial, cross(o, radial), o].forEach((direction, k) => { point = add(point, scaled(direction, steps[k] * patch.base[at + k])); });
      points.set(point, at + 3 * columns);
    }
  return {intervals, columns, hasPole: ends.map((end) => end.pole !== null), points};
}

/**
 * The grid of a patch at a size.
 * @param {any[]} ends of the patch (patchEnd)
 * @returns {Grid} with the numbers of rows and columns that are asked for
 */
export function patchGrid(compact, planes, bone, ends, rows, columns) {
  const patch = compact.patches[bone];
  let grid = coarseGrid(compact, planes, bone, ends);
  for (let number = 0; grid.intervals + 1 < rows || grid.columns < columns; ++number) {
    const isRows = doublesRows(patch, number), residuals = patch.steps[number];
    const fineEnds = isRows ? [] : ends.map((end) => endRow(end, 2 * grid.columns));
    const sites = isRows ? rowSites(grid) : columnSites(grid, fineEnds);
    if (residuals) moveSites(sites, grid.columns, residuals, number, compact.step, compact.weights[isRows ? 1 : 0]);
    grid = refined(grid, isRows, fineEnds, sites);
  }
  return grid;
}
