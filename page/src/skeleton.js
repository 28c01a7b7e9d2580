// SPDX-License-Identifier: MIT
// What the library computes per skeleton on the host: bases, separation planes, poses, and the walks that weigh bones
// (core/skeletex/skeleton). Positions are relative to the model's origin. End 0 of a bone is its head, end 1 its tail.
import {IDENTITY, add, cross, dot, inverse, mix, norm, normalized, rotate, scaled, sub, times, unit} from './vector.js';

/**
 * @typedef {{name: string, head: number, tail: number}} Bone
 * @typedef {{bones: Bone[], nodes: number[][], s: number[][]}} Skeleton
 * @typedef {{o: number[], s: number[], b: number[]}} Basis
 */

/** The interval of sorted keys that holds t, and the share of the way through it. */
export function interval(keys, t) {
  let i = 0;
  while (i + 2 < keys.length && keys[i + 1].t <= t) ++i;
  const next = Math.min(i + 1, keys.length - 1);
  const share = next === i ? 0 : Math.min(1, Math.max(0, (t - keys[i].t) / (keys[next].t - keys[i].t)));
  return {i, next, share};
}

/** The rotation of a morph as a whole, from the first skeleton on. */
const turnAt = (skeleton, t) => normalized(mix(IDENTITY, skeleton.turn, t));

/** Nodes of the mean of both skeletons: mean_nodes in core/skeletex/edit/morph/morph.h. */
function meanNodes(skeleton, t) {
  const {first, second} = skeleton;
  if (!second || t === 0) return first;
  if (t === 1) return second;
  const centres = [first, second].map((nodes) => scaled(nodes.reduce(add), 1 / nodes.length));
  const centre = mix(centres[0], centres[1], t), turn = turnAt(skeleton, t), back = inverse(skeleton.turn);
  return first.map((node, n) =>
    add(centre, rotate(turn, mix(sub(node, centres[0]), rotate(back, sub(second[n], centres[1])), t))));
}

/** @returns {Skeleton} the bind pose at a place of the morph */
export function skeletonAt(model, t) {
  const {skeleton} = model, {i, next, share} = interval(skeleton.keys, t), a = skeleton.keys[i], b = skeleton.keys[next];
  const nodes = meanNodes(skeleton, t).map((node) => sub(node, model.origin));
  if (share === 0) return {bones: skeleton.bones, nodes, s: a.s};
  // Directions between keys as they are seen from the morph as a whole, which turns.
  const turn = turnAt(skeleton, t), from_a = times(turn, inverse(turnAt(skeleton, a.t))), from_b = times(turn, inverse(turnAt(skeleton, b.t)));
  return {bones: skeleton.bones, nodes, s: a.s.map((s, n) => mix(rotate(from_a, s), rotate(from_b, b.s[n]), share))};
}

/** The ends of bones at each node, in the order of the bones: [bone, end]. */
export function endsAtNodes(skeleton) {
  const at = skeleton.nodes.map(() => []);
  skeleton.bones.forEach((bone, i) => {
    at[bone.head].push([i, 0]);
    at[bone.tail].push([i, 1]);
  });
  return at;
}

export const nodeOf = (skeleton, bone, end) => (end === 0 ? skeleton.bones[bone].head : skeleton.bones[bone].tail);
export const directionFrom = (skeleton, [bone, end]) =>
  unit(sub(skeleton.nodes[nodeOf(skeleton, bone, 1 - end)], skeleton.nodes[nodeOf(skeleton, bone, end)]));

/** Separation planes as they are seen from each bone. */
export class SeparationPlanes {
  /** @param {Skeleton} skeleton */
  constructor(skeleton) {
    this.skeleton = skeleton;
    /** @type {Basis[]} */
    this.bases = skeleton.bones.map((bone, i) => {
      const o = unit(sub(skeleton.nodes[bone.tail], skeleton.nodes[bone.head]));
      const s = unit(sub(skeleton.s[i], scaled(o, dot(o, skeleton.s[i]))));
      return {o, s, b: cross(o, s)};
    });
    /** Per bone and end the normals d_i - d_j. */
    this.normals = skeleton.bones.map(() => [[], []]);
    for (const ends of endsAtNodes(skeleton))
      for (const i of ends)
        for (const j of ends)
          if (i[0] !== j[0])
            this.normals[i[0]][i[1]].push(sub(directionFrom(skeleton, i), directionFrom(skeleton, j)));
  }

  isFree(bone, end) { return this.normals[bone][end].length === 0; }

  radial(bone, turn) {
    const angle = 2 * Math.PI * turn, {s, b} = this.bases[bone];
    return add(scaled(s, Math.cos(angle)), scaled(b, Math.sin(angle)));
  }

  /** The angle of an offset from a bone's node, in turns from 0 to 1. */
  turnOf(bone, offset) {
    const {s, b} = this.bases[bone], turn = Math.atan2(dot(offset, b), dot(offset, s)) / (2 * Math.PI);
    return turn - Math.floor(turn);
  }

  slope(bone, end, turn) {
    const normals = this.normals[bone][end];
    if (normals.length === 0) return 0;
    const direction = this.radial(bone, turn), o = this.bases[bone].o;
    let best = end === 0 ? -Infinity : Infinity;
    for (const normal of normals) {
      const x = -dot(direction, normal) / dot(o, normal);
      best = end === 0 ? Math.max(best, x) : Math.min(best, x);
    }
    return best;
  }

  seamPoint(bone, end, turn, distance) {
    const k = this.slope(bone, end, turn), length = Math.hypot(1, k);
    const isBesideBone = end === 0 ? k > 0 : k < 0;
    const f = scaled(add(this.radial(bone, turn), scaled(this.bases[bone].o, k)), 1 / length);
    return add(this.skeleton.nodes[nodeOf(this.skeleton, bone, end)], scaled(f, isBesideBone ? distance * length : distance));
  }
}

/** Axial parameter and latitude of a map coordinate u. */
export function axialOf(u, isHeadFree, isTailFree) {
  const begin = isHeadFree ? (isTailFree ? 1 / 3 : 0.5) : 0;
  const end = isTailFree ? (isHeadFree ? 2 / 3 : 0.5) : 1;
  if (u < begin) return {axial: 0, latitude: (-Math.PI / 2) * (begin - u) / begin};
  if (u > end) return {axial: 1, latitude: (Math.PI / 2) * (u - end) / (1 - end)};
  return {axial: (u - begin) / (end - begin), latitude: 0};
}

/**
 * The hierarchy that poses turn: bones in breadth-first order from each root.
 * @returns {{bone: number, before: number, pivot: number, closesCycle: boolean, isPosable: boolean}[]} pivot: the end
 *     nearer to the root; isPosable: the bone is in no cycle
 */
export function hierarchy(skeleton, roots) {
  const at = endsAtNodes(skeleton), all = [];
  for (const root of roots) {
    const entry = new Map([[root, -1]]), done = new Set(), queue = [root], links = [];
    for (let i = 0; i < queue.length; ++i)
      for (const [bone, end] of at[queue[i]]) {
        if (done.has(bone)) continue;
        done.add(bone);
        const next = nodeOf(skeleton, bone, 1 - end), closesCycle = entry.has(next);
        links.push({bone, before: entry.get(queue[i]), pivot: end, closesCycle, isPosable: !isInCycle(skeleton, at, bone)});
        if (closesCycle) continue;
        entry.set(next, bone);
        queue.push(next);
      }
    all.push(...links);
  }
  return all;
}

/** Whether a bone's ends still hang together without it. */
function isInCycle(skeleton, at, without) {
  const queue = [skeleton.bones[without].head], reached = new Set(queue);
  for (let i = 0; i < queue.length; ++i)
    for (const [bone, end] of at[queue[i]]) {
      const next = nodeOf(skeleton, bone, 1 - end);
      if (bone === without || reached.has(next)) continue;
      reached.add(next);
      queue.push(next);
    }
  return reached.has(skeleton.bones[without].tail);
}

/**
 * The skeleton in a pose.
 * @param {Map<number, number[]>} rotations per turned bone a quaternion in the bind pose's world axes
 * @returns {{nodes: number[][], rotations: number[][]}} rotations: of every bone, with those before it
 */
export function posed(skeleton, links, rotations) {
  const nodes = skeleton.nodes.map((node) => node), turned = skeleton.bones.map(() => IDENTITY);
  for (const {bone, before, pivot, closesCycle, isPosable} of links) {
    const carried = before < 0 ? IDENTITY : turned[before];
    turned[bone] = normalized(times(carried, (isPosable && rotations.get(bone)) || IDENTITY));
    if (closesCycle) continue;
    const fixed = nodeOf(skeleton, bone, pivot), moved = nodeOf(skeleton, bone, 1 - pivot);
    nodes[moved] = add(nodes[fixed], rotate(turned[bone], sub(skeleton.nodes[moved], skeleton.nodes[fixed])));
  }
  return {nodes, rotations: turned};
}

/** The motion of every bone as a dual quaternion, eight numbers each, signs along the skeleton. */
export function motions(skeleton, pose) {
  const at = endsAtNodes(skeleton), done = new Set(), real = pose.rotations.map((q) => q);
  for (let start = 0; start < real.length; ++start) {
    if (done.has(start)) continue;
    done.add(start);
    const queue = [start];
    for (let i = 0; i < queue.length; ++i)
      for (const end of [0, 1])
        for (const [next] of at[nodeOf(skeleton, queue[i], end)]) {
          if (done.has(next)) continue;
          done.add(next);
          const q = real[next], p = real[queue[i]];
          if (q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3] < 0) real[next] = q.map((x) => -x);
          queue.push(next);
        }
  }
  return skeleton.bones.map((bone, i) => {
    const q = real[i], move = sub(pose.nodes[bone.head], rotate(q, skeleton.nodes[bone.head]));
    return [...q, ...times([...scaled(move, 0.5), 0], q)];
  });
}

const MOST_JOINTS = 6, MOST_STEPS = 1024;

/** The distance that half of the length of the pieces does not exceed, as in weight_walk.cpp. */
function medianDistance(pieces) {
  let low = Infinity, high = 0, half = 0;
  for (const {nearest, furthest, length} of pieces) {
    low = Math.min(low, nearest);
    high = Math.max(high, furthest);
    half += length / 2;
  }
  for (let i = 0; i < 40; ++i) {
    const middle = (low + high) / 2;
    let below = 0;
    for (const {nearest, furthest, length} of pieces)
      below += length * Math.min(1, Math.max(0, (middle - nearest) / Math.max(furthest - nearest, 1e-12 * furthest)));
    if (below < half) low = middle;
    else high = middle;
  }
  return (low + high) / 2;
}

/**
 * The walks of weight_walk.h: per bone the steps that lead from it to others.
 * @param {{node: number, points: {distance: number, point: number[]}[]}[]} arcs the seams' polylines
 * @returns {{first: number[], steps: {normal: number[], girthInverse: number, joint: number[], seamRadius: number,
 *     bone: number, before: number, same: number}[], longest: number}} first: one more than there are bones
 */
export function weightWalks(skeleton, arcs, diagonal) {
  const pieces = skeleton.nodes.map(() => []), radii = skeleton.nodes.map(() => 0);
  for (const {node, points} of arcs)
    points.forEach(({distance, point}, i) => {
      radii[node] = Math.max(radii[node], norm(sub(point, skeleton.nodes[node])));
      if (i === 0) return;
      const before = points[i - 1];
      pieces[node].push({
        nearest: Math.min(before.distance, distance), furthest: Math.max(before.distance, distance),
        length: norm(sub(point, before.point))
      });
    });
  const girths = pieces.map((list) => (list.length === 0 ? diagonal : Math.max(medianDistance(list), 1e-6 * diagonal)));
  const at = endsAtNodes(skeleton), steps = [], first = [0];
  let longest = 0;
  skeleton.bones.forEach((_, own) => {
    const own_steps = [], places = [{bone: own, joint: -1, before: -1, joints: 0}], first_step_to = new Map();
    const hasCrossed = (place, joint) => {
      for (let i = place; i >= 0; i = places[i].before)
        if (places[i].joint === joint) return true;
      return false;
    };
    for (let here = 0; here < places.length; ++here) {
      const place = places[here];
      if (place.joints === MOST_JOINTS) continue;
      for (const end of [0, 1]) {
        const node = nodeOf(skeleton, place.bone, end);
        if (hasCrossed(here, node)) continue;
        for (const next of at[node]) {
          if (next[0] === place.bone || next[0] === own || own_steps.length === MOST_STEPS) continue;
          const normal = sub(directionFrom(skeleton, [place.bone, end]), directionFrom(skeleton, next));
          const same = first_step_to.get(next[0]) ?? -1;
          if (same < 0) first_step_to.set(next[0], own_steps.length);
          own_steps.push({
            normal: scaled(normal, 1 / girths[node]), girthInverse: 1 / girths[node], joint: skeleton.nodes[node],
            seamRadius: radii[node], bone: next[0], before: here - 1, same
          });
          places.push({bone: next[0], joint: node, before: here, joints: place.joints + 1});
        }
      }
    }
    steps.push(...own_steps);
    first.push(steps.length);
    longest = Math.max(longest, own_steps.length);
  });
  return {first, steps, longest};
}

/** The rotation of one bone that brings its far end to where it points at a place, others of the pose kept. */
export function turnedTowards(skeleton, pose, link, turn) {
  const carried = link.before < 0 ? IDENTITY : pose.rotations[link.before];
  return normalized(times(inverse(carried), times(turn, pose.rotations[link.bone])));
}
