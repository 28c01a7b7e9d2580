// SPDX-License-Identifier: MIT
// The texels of a compact model's points (core/skeletex/compact/decode_model.cpp).
import {SeparationPlanes, axialOf, nodeOf, skeletonAt} from '../skeleton.js';
import {add, cross, dot, mix, norm, scaled, sub, unit} from '../vector.js';
import {readCompact} from './file.js';
import {patchGrid} from './grid.js';
import {patchEnd, seamsOf} from './seams.js';

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

/**
 * @param {any} model the page's, with `ends`: per bone and end the arcs around, [arc, whether it is reversed]
 * @param {Uint8Array} payload of a compact model, as far as the level needs it
 * @param {{width: number, height: number, patches: number[][], rows: Float32Array}} level
 * @returns {Float32Array} four floats a texel: along, around, out, 0
 */
export function compactTexels(model, payload, level) {
  const planes = new SeparationPlanes(skeletonAt(model, 0)), compact = readCompact(payload, planes);
  const seams = seamsOf(compact, planes), texels = new Float32Array(4 * level.width * level.height);
  let firstRow = 0;
  level.patches.forEach((rectangle, bone) => {
    const [, , width, height] = rectangle;
    const ends = [0, 1].map((end) => patchEnd(compact, planes, seams, bone, end, model.ends[bone][end]));
    const grid = patchGrid(compact, planes, bone, ends, height, width);
    store(planes, level, bone, rectangle, grid, level.rows.subarray(firstRow, firstRow += height), texels);
  });
  return texels;
}
