// SPDX-License-Identifier: MIT
// Vectors as arrays of three numbers, quaternions as [x, y, z, w].

/** @typedef {number[]} Vector */

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const norm = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => scaled(a, 1 / norm(a));
export const mix = (a, b, share) => a.map((x, i) => x + share * (b[i] - x));

export const IDENTITY = [0, 0, 0, 1];
/** The rotation b, then a. */
export const times = (a, b) => [
  a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
  a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
  a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
  a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]];
export const inverse = (q) => [-q[0], -q[1], -q[2], q[3]];
export const normalized = (q) => {
  const length = Math.hypot(...q);
  return q.map((x) => x / length);
};
export const rotate = (q, v) => {
  const t = scaled(cross(q, v), 2);
  return add(add(v, scaled(t, q[3])), cross(q, t));
};
/** The smallest rotation from one unit vector to another. */
export const between = (from, to) => {
  const w = 1 + dot(from, to);
  if (w > 1e-9) return normalized([...cross(from, to), w]);
  const side = Math.abs(from[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
  return [...unit(cross(from, side)), 0];
};
/** @param {Vector} axis of length 1 @param {number} angle in radians */
export const about = (axis, angle) => [...scaled(axis, Math.sin(angle / 2)), Math.cos(angle / 2)];
