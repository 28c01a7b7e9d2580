// SPDX-License-Identifier: MIT
// The lattice of one level and one stage: vertices, triangles, and where both lie in the texture.
import {array, unpackSteps} from './data.js';

/**
 * @typedef {object} Lattice
 * @property {number} innerCount
 * @property {number} vertexCount with the copies around the ends
 * @property {Int32Array} places four numbers per vertex: bone, row, column, and the number of a seam's point or -1
 * @property {Int32Array} sources per copy, its vertex in the library's mesh, counted from the inner ones on
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
function makeRings(innerCount, copies, isPole, sources, endTriangles) {
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
    if (isPole.has(source) && ring.length > 8) {
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

/** @returns {Lattice} */
export function makeLattice(arrays, level, stage, bonesOfSeams) {
  const sources = array(arrays, stage.sources), ends = unpackSteps(arrays, stage.columns).values;
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
  const poleCount = bonesOfSeams.poleCount, isPole = new Set();
  stage.copies.forEach((count, end) => {
    const bone = end >> 1, row = end & 1 ? level.patches[bone][3] - 1 : 0;
    for (let i = 0; i < count; ++i, ++vertex) {
      const source = sources[vertex - innerCount];
      if (source < poleCount) {
        places.set([bone, row, 0, -1], 4 * vertex);
        isPole.add(source);
      } else {
        places.set([bonesOfSeams.bones[source - poleCount], row, 0, source - poleCount], 4 * vertex);
      }
      columns[vertex] = ends[vertex - innerCount];
      patches[vertex] = bone;
    }
  });
  const differences = array(arrays, stage.triangles);
  const endTriangles = new Uint32Array(differences.length);
  for (let i = 0; i < differences.length; ++i) endTriangles[i] = differences[i] + (i >= 3 ? endTriangles[i - 3] : 0);
  const quads = level.patches.reduce((sum, [, , width, height]) => sum + width * (height - 3), 0);
  const triangles = new Uint32Array(6 * quads + endTriangles.length);
  triangles.set(endTriangles, addQuads(level, array(arrays, stage.diagonals), triangles));
  return {
    innerCount, vertexCount, places, sources, columns, patches, triangles,
    rings: makeRings(innerCount, sources.length, isPole, sources, endTriangles)
  };
}
