// SPDX-License-Identifier: MIT
// The seams of a compact model, and the points of patches' ends on them (core/skeletex/compact/seam_curves.h,
// core/skeletex/geometry/loop_turns.h).
import {directionFrom, nodeOf} from '../skeleton.js';
import {add, cross, dot, mix, norm, scaled, sub, unit} from '../vector.js';

/** Weights of Lagrange's polynomial through the points -before + 1 .. after, at 1/2. */
function weightsOf(before, after) {
  return Array.from({length: before + after}, (_, i) => {
    let numerator = 1, denominator = 1;
    for (let k = 0; k < before + after; ++k) {
      if (k === i) continue;
      numerator *= 0.5 - (k + 1 - before);
      denominator *= i - k;
    }
    return numerator / denominator;
  });
}
const TABLE = [1, 2, 3].map((before) => [1, 2, 3].map((after) => weightsOf(before, after)));
/** @param {number} before @param {number} after points on each side, 1 to 3 */
export const halfwayWeights = (before, after) => TABLE[before - 1][after - 1];

/** The plane of an arc: a point on it and two unit directions. */
function arcPlane(planes, {node, bones}) {
  const away = (bone) => directionFrom(planes.skeleton, [bone, endAt(planes.skeleton, bone, node)]);
  const normal = unit(sub(away(bones[0]), away(bones[1]))), basis = planes.bases[bones[0]];
  const inPlane = (v) => sub(v, scaled(normal, dot(v, normal)));
  const s = inPlane(basis.s), x = unit(dot(s, s) >= 0.25 ? s : inPlane(basis.b));
  return {node: planes.skeleton.nodes[node], x, y: cross(normal, x)};
}

export const endAt = (skeleton, bone, node) => (skeleton.bones[bone].head === node ? 0 : 1);

/** A curve with a further point halfway between each two. */
function refinedCurve(points, isClosed, q, step) {
  const count = points.length, fine = [];
  for (let i = 0; i < count; ++i) {
    fine.push(points[i]);
    if (!isClosed && i === count - 1) break;
    const before = isClosed ? 3 : Math.min(3, i + 1), after = isClosed ? 3 : Math.min(3, count - 1 - i);
    const at = (k) => points[(((i + k) % count) + count) % count];
    let [x, y] = [0, 0];
    halfwayWeights(before, after).forEach((weight, k) => {
      const point = at(1 - before + k);
      x += weight * point[0];
      y += weight * point[1];
    });
    if (step) {
      const chord = [at(1)[0] - at(0)[0], at(1)[1] - at(0)[1]], length = Math.hypot(...chord);
      const side = length > 0 ? [chord[0] / length, chord[1] / length] : [1, 0];
      const out = q * step.normal[i], along = step.side ? 8 * q * step.side[i] : 0;
      x += along * side[0] - out * side[1];
      y += along * side[1] + out * side[0];
    }
    fine.push([x, y]);
  }
  return fine;
}

/** Corners, and the points of every arc between its corners. @param {number} octaves halvings beyond the size of the file */
export function seamsOf(compact, planes, octaves) {
  const {step: q, arcs} = compact;
  const corners = compact.corners.map(({node, bone, turn, distance}) =>
    planes.seamPoint(bone, endAt(planes.skeleton, bone, node), turn, distance));
  return {corners, arcs: arcs.map((arc) => {
    const plane = arcPlane(planes, arc), isClosed = arc.corners[0] < 0;
    const coordinates = (p) => [dot(sub(p, plane.node), plane.x), dot(sub(p, plane.node), plane.y)];
    let curve = isClosed ? [0, 1, 2, 3].map((i) => [q * arc.base[2 * i], q * arc.base[2 * i + 1]])
      : arc.corners.map((corner) => coordinates(corners[corner]));
    for (let step = 0; step < Math.max(isClosed ? 0 : 1, arc.stepCount + octaves); ++step)
      curve = refinedCurve(curve, isClosed, q, arc.steps[step]);
    const inner = isClosed ? curve : curve.slice(1, -1);
    return inner.map(([x, y]) => add(plane.node, add(scaled(plane.x, x), scaled(plane.y, y))));
  })};
}

const EVEN_PART = 1e-4, LEAST_DENSITY = 0.4;

/** The nearest sequence that grows by at least spacing[i] from i to i + 1: pool adjacent violators. */
function nearestIncreasing(y, weights, spacing) {
  const offsets = [], blocks = [];
  y.forEach((value, i) => {
    offsets.push(i > 0 ? offsets[i - 1] + spacing[i - 1] : 0);
    blocks.push({sum: weights[i] * (value - offsets[i]), weight: weights[i], count: 1});
    for (let last = blocks.length - 1; last > 0; --last) {
      const [a, b] = [blocks[last - 1], blocks[last]];
      if (a.sum / a.weight <= b.sum / b.weight) break;
      blocks.splice(last - 1, 2, {sum: a.sum + b.sum, weight: a.weight + b.weight, count: a.count + b.count});
    }
  });
  const x = [];
  for (const {sum, weight, count} of blocks)
    for (let k = 0; k < count; ++k) x.push(count === 1 ? y[x.length] : sum / weight + offsets[x.length]);
  return x;
}

/** The v of a loop's points, growing (loop_turns); even where the loop does not wind once around the bone. */
function loopTurns(points, turns) {
  const n = points.length, lifted = [turns[0]], lengths = [];
  for (let i = 0; i < n; ++i) {
    const difference = turns[(i + 1) % n] - turns[i];
    lifted.push(lifted[i] + difference - Math.round(difference));
    lengths.push(norm(sub(points[(i + 1) % n], points[i])));
  }
  if (n < 3 || !(Math.abs(lifted[n] - lifted[0] - 1) <= 1e-6)) return points.map((_, i) => turns[0] + i / n);
  lifted.pop();
  const total = lengths.reduce((sum, length) => sum + length, 0);
  const spacing = lengths.map((length) => (LEAST_DENSITY - EVEN_PART) * (total > 0 ? length / total : 0) + EVEN_PART / n);
  const weights = spacing.map((space, i) => space + spacing[(i + n - 1) % n]);
  const thrice = (values) => [...values, ...values, ...values];
  const all = [-1, 0, 1].flatMap((period) => lifted.map((turn) => turn + period));
  return nearestIncreasing(all, thrice(weights), thrice(spacing)).slice(n, 2 * n);
}

/** An end of a patch: its pole, or the polyline of its seam with the v of every point. */
export function patchEnd(compact, planes, seams, bone, end, uses) {
  const node = planes.skeleton.nodes[nodeOf(planes.skeleton, bone, end)];
  if (uses.length === 0) {
    const {s, b, o} = planes.bases[bone], offset = compact.patches[bone].poles[end].map((x) => x * compact.step);
    return {pole: add(node, add(scaled(s, offset[0]), add(scaled(b, offset[1]), scaled(o, offset[2]))))};
  }
  const points = uses.flatMap(([arc, isReversed]) => {
    const {corners} = compact.arcs[arc], inner = isReversed ? [...seams.arcs[arc]].reverse() : seams.arcs[arc];
    return corners[0] < 0 ? inner : [seams.corners[corners[isReversed ? 1 : 0]], ...inner];
  });
  return {pole: null, points, turns: loopTurns(points, points.map((point) => planes.turnOf(bone, sub(point, node))))};
}

/** The points of an end at a number of columns, three numbers each. */
export function endRow({pole, points, turns}, columns) {
  const row = new Float64Array(3 * columns);
  if (pole) {
    for (let column = 0; column < columns; ++column) row.set(pole, 3 * column);
    return row;
  }
  const n = points.length, turnAt = (i) => (i < n ? turns[i] : turns[0] + 1), first = Math.ceil(turns[0] * columns);
  for (let i = 0, at = 0; i < columns; ++i) {
    const turn = (first + i) / columns;
    while (at + 2 < n + 1 && turnAt(at + 1) < turn) ++at;
    const span = turnAt(at + 1) - turnAt(at), share = span > 0 ? Math.min(1, Math.max(0, (turn - turnAt(at)) / span)) : 0;
    row.set(mix(points[at], points[(at + 1) % n], share), 3 * ((((first + i) % columns) + columns) % columns));
  }
  return row;
}
