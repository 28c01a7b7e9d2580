// SPDX-License-Identifier: MIT
// A level of a compact model, decoded (core/skeletex/compact/decode_model.cpp).
import {SeparationPlanes, axialOf, directionFrom, nodeOf, skeletonAt} from '../skeleton.js';
import {add, cross, dot, mix, norm, scaled, sub, unit} from '../vector.js';
import {Diagonals} from './diagonals.js';
import {readCompact} from './file.js';
import {patchGrid} from './grid.js';
import {endAt, patchEnd, seamsOf} from './seams.js';

function distanceToBone(point, head, tail) {
  const bone = sub(tail, head), offset = sub(point, head);
  const share = Math.min(1, Math.max(0, dot(offset, bone) / dot(bone, bone)));
  return norm(sub(offset, scaled(bone, share)));
}

/** The frames of a patch's columns, whose rows share them. */
function columnFrames(planes, bone, count) {
  return Array.from({length: count}, (_, column) => {
    const turn = column / count, radial = planes.radial(bone, turn);
    return {radial, around: cross(planes.bases[bone].o, radial), slopes: [0, 1].map((end) => planes.slope(bone, end, turn))};
  });
}

/** Stores the texels of a patch's grid of points. */
function store(planes, level, bone, [x, y, width, height], grid, rows, texels) {
  const {o} = planes.bases[bone], {nodes} = planes.skeleton;
  const [head, tail] = [0, 1].map((end) => nodes[nodeOf(planes.skeleton, bone, end)]);
  const columns = columnFrames(planes, bone, width);
  for (let row = 0; row < height; ++row) {
    const {axial, latitude} = axialOf(rows[row], planes.isFree(bone, 0), planes.isFree(bone, 1));
    const cosine = Math.cos(latitude), sine = Math.sin(latitude), foot = mix(head, tail, axial);
    for (let column = 0; column < width; ++column) {
      const {radial, around, slopes} = columns[column], k = (1 - axial) * slopes[0] + axial * slopes[1];
      const out = unit(add(scaled(radial, cosine), scaled(o, cosine * k + sine))), along = cross(out, around);
      const at = 3 * (row * width + column), point = grid.points.subarray(at, at + 3);
      const offset = sub(point, foot), length = norm(offset);
      const scale = length > 0 ? distanceToBone(point, head, tail) / length : 0;
      texels.set([scale * dot(offset, along), scale * dot(offset, around), scale * dot(offset, out)],
                 4 * ((y + row) * level.width + x + column));
    }
  }
}

/** u of rows: a monotone cubic (Fritsch and Carlson) through knots. */
function rowTable(knots, rows) {
  const y = [0, ...knots, 1], rises = y.slice(1).map((value, i) => value - y[i]);
  const slopes = y.map((_, i) => {
    const left = rises[Math.max(0, i - 1)], right = rises[Math.min(3, i)];
    return 2 * left * right / (left + right);
  });
  return Float32Array.from({length: rows}, (_, row) => {
    const x = 4 * row / (rows - 1), i = Math.min(3, Math.floor(x)), t = x - i, s = 1 - t;
    return s * s * (1 + 2 * t) * y[i] + t * t * (1 + 2 * s) * y[i + 1] + t * s * s * slopes[i] - t * t * s * slopes[i + 1];
  });
}

/** Turn and distance of every sample, arc by arc, then of every corner: what a page of texels has as tables. */
function seamTables(compact, planes, seams) {
  const {skeleton} = planes, turns = [], distances = [];
  compact.arcs.forEach(({node, bones: [bone]}, arc) => {
    const direction = directionFrom(skeleton, [bone, endAt(skeleton, bone, node)]);
    for (const point of seams.arcs[arc]) {
      const offset = sub(point, skeleton.nodes[node]), along = Math.max(0, dot(offset, direction));
      turns.push(planes.turnOf(bone, offset));
      distances.push(norm(sub(offset, scaled(direction, along))));
    }
  });
  for (const {turn, distance} of compact.corners) {
    turns.push(turn);
    distances.push(distance);
  }
  return {t: 0, turns, distances};
}

/**
 * Decodes a level of a compact model, to what a page of texels holds of it.
 * @param {any} model the page's
 * @param {Uint8Array} payload of the compact model, as far as the level needs it
 * @param {any} level gains `rows`, `values` (four floats a texel: along, around, out, 0), and its stage `keys` and `diagonals`
 */
export function decodeLevel(model, payload, level) {
  const planes = new SeparationPlanes(skeletonAt(model, 0)), compact = readCompact(payload, planes), [stage] = level.stages;
  const seams = seamsOf(compact, planes, 0), rows = level.patches.map(([, , , height], bone) => rowTable(compact.patches[bone].knots, height));
  level.values = new Float32Array(4 * level.width * level.height);
  const diagonals = new Diagonals(level.patches);
  level.patches.forEach((rectangle, bone) => {
    const [, , width, height] = rectangle;
    const ends = [0, 1].map((end) => patchEnd(compact, planes, seams, bone, end, stage.ends[bone][end]));
    const grid = patchGrid(compact, planes, bone, ends, height, width);
    store(planes, level, bone, rectangle, grid, rows[bone], level.values);
    diagonals.add(grid.points, width, height);
  });
  level.rows = Float32Array.from(rows.flatMap((table) => [...table]));
  stage.keys = [seamTables(compact, planes, seamsOf(compact, planes, level.octaves))];
  stage.diagonals = diagonals.bits;
}
