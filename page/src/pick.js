// SPDX-License-Identifier: MIT
// What lies under the cursor.

/**
 * The nearest triangle that a ray meets, and the texel there.
 * @param {import('./surface.js').Surface} surface
 * @param {number[]} origin @param {number[]} direction
 * @returns {{bone: number, row: number, column: number, point: number[], vertex: number} | null}
 */
export function pick(surface, origin, direction) {
  const points = surface.positions(), {triangles} = surface.lattice;
  const [ox, oy, oz] = origin, [dx, dy, dz] = direction;
  let best = Infinity, found = -1, u0 = 0, v0 = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ax = points[a], ay = points[a + 1], az = points[a + 2];
    const e1x = points[b] - ax, e1y = points[b + 1] - ay, e1z = points[b + 2] - az;
    const e2x = points[c] - ax, e2y = points[c + 1] - ay, e2z = points[c + 2] - az;
    const px = dy * e2z - dz * e2y, py = dz * e2x - dx * e2z, pz = dx * e2y - dy * e2x;
    const determinant = e1x * px + e1y * py + e1z * pz;
    if (determinant === 0) continue;
    const sx = ox - ax, sy = oy - ay, sz = oz - az, u = (sx * px + sy * py + sz * pz) / determinant;
    if (u < 0 || u > 1) continue;
    const qx = sy * e1z - sz * e1y, qy = sz * e1x - sx * e1z, qz = sx * e1y - sy * e1x;
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (v < 0 || u + v > 1) continue;
    const distance = (e2x * qx + e2y * qy + e2z * qz) / determinant;
    if (distance > 0 && distance < best) [best, found, u0, v0] = [distance, t, u, v];
  }
  if (found < 0) return null;
  const corners = [triangles[found], triangles[found + 1], triangles[found + 2]], weights = [1 - u0 - v0, u0, v0];
  const {places, columns, patches} = surface.lattice, last = corners[2], bone = patches[last];
  const width = surface.level.patches[bone][2];
  let row = 0, column = 0;
  corners.forEach((corner, i) => {
    row += weights[i] * places[4 * corner + 1];
    column += weights[i] * (columns[corner] - width * Math.round((columns[corner] - columns[last]) / width));
  });
  const vertex = corners[weights.indexOf(Math.max(...weights))];
  return {bone, row, column: ((column % width) + width) % width, vertex, point: [ox + best * dx, oy + best * dy, oz + best * dz]};
}

/** The vertex that shows a texel of the texture, or null where no patch lies. */
export function vertexAt(surface, x, y) {
  let first = 0;
  for (let bone = 0; bone < surface.level.patches.length; ++bone) {
    const [left, top, width, height] = surface.level.patches[bone];
    if (x >= left && x < left + width && y >= top && y < top + height) {
      const row = Math.min(height - 2, Math.max(1, y - top));
      return {bone, row: y - top, column: x - left, vertex: first + (row - 1) * width + x - left};
    }
    first += width * (height - 2);
  }
  return null;
}
