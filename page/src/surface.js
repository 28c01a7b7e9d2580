// SPDX-License-Identifier: MIT
// The surface on the GPU: textures, and the program whose vertex shader moves the lattice (surface.glsl). Transform
// feedback keeps the points, so that turning the camera costs nothing and drawn points can be read back.
import capsule from '../../kernels/capsule.h';
import skinWeight from '../../kernels/skin_weight.h';
import {blendedTexels} from './blend.js';
import {decodeLevel} from './compact/level.js';
import {array, unpackKeys, unpackSteps, unpackTexels} from './data.js';
import {makeLattice} from './lattice.js';
import {SeparationPlanes, axialOf, hierarchy, interval, motions, posed, skeletonAt, weightWalks} from './skeleton.js';
import shader from './surface.glsl';

const TABLE_WIDTH = 1024;

function rowsAt(level, t) {
  return t === 0 ? level.rows : level.rows.map((u, r) => u + t * (level.second.rows[r] - u));
}

function stageAt(level, t) {
  let stage = level.stages[0];
  for (const other of level.stages) if (other.keys[0].t <= t) stage = other;
  return stage;
}

/** Bones that own seam points, in the order of the points, and the number of poles before them. */
function bonesOfSeams(stage, planes) {
  const bones = stage.arcs.flatMap((arc) => Array(arc.samples).fill(arc.bone)).concat(stage.corners.map((corner) => corner.bone));
  let poleCount = 0;
  planes.normals.forEach((_, bone) => [0, 1].forEach((end) => { poleCount += planes.isFree(bone, end) ? 1 : 0; }));
  return {bones, poleCount};
}

export class Surface {
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {any} model @param {ArrayBuffer} arrays of the levels that are loaded, the coarsest first
   */
  constructor(gl, model, arrays) {
    this.gl = gl;
    this.model = model;
    this.arrays = arrays;
    this.state = {level: 0, t: 0, rotations: new Map(), transferred: new Set()};
    this.links = hierarchy(skeletonAt(model, 0), model.roots);
    this.stage = null;
    this.lattice = null;
    this.textures = {};
    this.points = gl.createBuffer();
    this.normals = gl.createBuffer();
    this.feedback = gl.createTransformFeedback();
    this.makeProgram();
  }

  makeProgram() {
    const gl = this.gl, skeleton = skeletonAt(this.model, 0);
    const {longest} = weightWalks(skeleton, [], this.model.diagonal);
    const header = '#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n' +
        `precision highp isampler2D;\n#define MOST_STEPS ${longest}\n${capsule.replace(/\bconst /g, '')}\n${skinWeight}\n`;  // GLSL ES: only constants are const
    const program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, header + shader], [gl.FRAGMENT_SHADER, '#version 300 es\nvoid main() {}']]) {
      const part = gl.createShader(type);
      gl.shaderSource(part, text);
      gl.compileShader(part);
      if (!gl.getShaderParameter(part, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(part));
      gl.attachShader(program, part);
    }
    gl.transformFeedbackVaryings(program, ['point', 'normal'], gl.SEPARATE_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(program));
    this.program = program;
    this.at = (name) => gl.getUniformLocation(program, name);
  }

  get level() { return this.model.levels[this.state.level]; }

  /** Sets a texture's content. Kinds of content: 'float' and 'int', four per texel. */
  setTexture(name, kind, values, width) {
    const gl = this.gl, height = Math.max(1, Math.ceil(values.length / 4 / width)), size = 4 * width * height;
    if (values.length !== size) {
      const padded = new values.constructor(size);
      padded.set(values);
      values = padded;
    }
    this.textures[name] ??= gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.textures[name]);
    for (const [key, value] of [[gl.UNPACK_FLIP_Y_WEBGL, false], [gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false], [gl.UNPACK_ALIGNMENT, 4]])
      gl.pixelStorei(key, value);
    if (kind === 'float') gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, values);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32I, width, height, 0, gl.RGBA_INTEGER, gl.INT, values);
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
                                [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_2D, key, value);
  }

  /** The payload of a compact model as far as a level needs it. */
  payload(level) {
    const {levels} = this.model, pieces = levels.slice(levels.indexOf(level)).reverse().map(({payload}) => array(this.arrays, payload));
    const bytes = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
    let at = 0;
    for (const piece of pieces) {
      bytes.set(piece, at);
      at += piece.length;
    }
    return bytes;
  }

  /** Unpacks a level when it is first shown. */
  unpack(level) {
    if (level.isUnpacked) return;
    level.isUnpacked = true;
    const {second, transfer, blend} = level;
    if (level.payload) {
      decodeLevel(this.model, this.payload(level), level);
      return;
    }
    for (const texture of [level, second, transfer]) {
      if (!texture) continue;
      texture.rows = array(this.arrays, texture.rows);
      texture.values = unpackTexels(this.arrays, texture);
    }
    for (const stage of level.stages) {
      unpackKeys(this.arrays, stage.keys, ['turns', 'distances']);
      stage.diagonals = array(this.arrays, stage.diagonals);
    }
    if (!second) return;
    transfer.values = transfer.values.map((value, i) => value - level.values[i]);  // what it moves
    transfer.rows = transfer.rows.map((u, i) => u - level.rows[i]);
    unpackKeys(this.arrays, blend.keys, ['columns', 'moves']);
    const slopes = unpackSteps(this.arrays, blend.slopes).values;
    let begin = 0;
    blend.sourceSlopes = blend.sources.map(([, , width]) => slopes.subarray(begin, begin += 2 * width));
  }

  /** Brings the surface to a state. @returns {boolean} whether the lattice is a new one */
  update(change) {
    const before = {...this.state};
    Object.assign(this.state, change);
    const {t} = this.state, level = this.level;
    this.unpack(level);
    this.bind = skeletonAt(this.model, t);
    this.planes = new SeparationPlanes(this.bind);
    this.pose = posed(this.bind, this.links, this.state.rotations);
    const stage = stageAt(level, t);
    const isNewLattice = stage !== this.stage;
    if (isNewLattice) {
      this.stage = stage;
      this.owners = bonesOfSeams(stage, this.planes);
      this.lattice = makeLattice(this.arrays, level, stage, this.owners);
      this.setTexture('places', 'int', this.lattice.places, TABLE_WIDTH);
      this.setTexture('rings', 'int', this.lattice.rings, TABLE_WIDTH);
      const gl = this.gl, bytes = 12 * this.lattice.vertexCount;
      for (const buffer of [this.points, this.normals]) {
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.DYNAMIC_COPY);
      }
    }
    if (isNewLattice || before.t !== t || before.level !== this.state.level) this.setTexels();
    this.setTables();
    this.run();
    this.readBack = null;
    return isNewLattice;
  }

  setTexels() {
    const level = this.level, {t} = this.state;
    this.texels = t === 0 ? level.values : blendedTexels(level, this.planes, rowsAt(level, t), t);
    this.setTexture('texels', 'float', this.texels, level.width);
    const moves = level.transfer?.values ?? level.values;
    if (this.uploadedMoves !== moves) this.setTexture('transfer_moves', 'float', moves, level.width);
    this.uploadedMoves = moves;
  }

  /** Seam points at the state's place of the morph. */
  seamPoints() {
    const {stage, planes} = this, {i, next, share} = interval(stage.keys, this.state.t);
    const a = stage.keys[i], b = stage.keys[next], points = [];
    const addPoint = (node, bone) => {
      const at = points.length, there = b.turns[at] - Math.round(b.turns[at] - a.turns[at]);  // the short way round
      const turn = a.turns[at] + share * (there - a.turns[at]), distance = a.distances[at] + share * (b.distances[at] - a.distances[at]);
      const end = this.bind.bones[bone].head === node ? 0 : 1;
      points.push({distance, point: planes.seamPoint(bone, end, turn, distance)});
    };
    for (const arc of stage.arcs) for (let k = 0; k < arc.samples; ++k) addPoint(arc.node, arc.bone);
    for (const corner of stage.corners) addPoint(corner.node, corner.bone);
    return points;
  }

  /** The seams' polylines, from corner to corner or once round. */
  seamArcs(points) {
    const {arcs} = this.stage, firstCorner = arcs.reduce((sum, arc) => sum + arc.samples, 0);
    let first = 0;
    return arcs.map(({node, samples, corners}) => {
      const inner = points.slice(first, first += samples);
      if (corners[0] < 0) return {node, points: [...inner, ...inner.slice(0, 1)]};
      return {node, points: [points[firstCorner + corners[0]], ...inner, points[firstCorner + corners[1]]]};
    });
  }

  setTables() {
    const {bind, planes, level, state} = this;
    const rows = rowsAt(level, state.t), transferredRows = level.transfer?.rows;
    const isPosed = [...state.rotations.values()].some((q) => q[3] !== 1);
    const seams = this.seamPoints();
    const walks = isPosed ? weightWalks(bind, this.seamArcs(seams), this.model.diagonal) : {first: [0, ...bind.bones.map(() => 0)], steps: []};
    const values = [], rowValues = [], columnValues = [];
    level.patches.forEach(([x, y, width, height], bone) => {
      const {o, s, b} = planes.bases[bone], head = bind.nodes[bind.bones[bone].head], tail = bind.nodes[bind.bones[bone].tail];
      const length = Math.hypot(...tail.map((p, i) => p - head[i]));
      const isTransferred = state.transferred.has(bone), firstRow = rowValues.length / 4;
      values.push(...head, length, ...o, walks.first[bone + 1] - walks.first[bone], ...s, 0, ...b, 0, x, y, width, height,
                  firstRow, columnValues.length / 4, isTransferred ? 1 - state.t : 0, walks.first[bone]);
      const isHeadFree = planes.isFree(bone, 0), isTailFree = planes.isFree(bone, 1);
      for (let r = 0; r < height; ++r) {
        let u = rows[firstRow + r];
        if (isTransferred) u += (1 - state.t) * transferredRows[firstRow + r];
        const {axial, latitude} = axialOf(u, isHeadFree, isTailFree);
        rowValues.push(axial, Math.cos(latitude), Math.sin(latitude), 0);
      }
      for (let j = 0; j < width; ++j) {
        const angle = 2 * Math.PI * j / width;
        columnValues.push(Math.cos(angle), Math.sin(angle), planes.slope(bone, 0, j / width), planes.slope(bone, 1, j / width));
      }
    });
    const at = {};
    const append = (name, list) => {
      at[name] = values.length / 4;
      for (const value of list) values.push(value);
    };
    append('rows_at', rowValues);
    append('columns_at', columnValues);
    append('seams_at', seams.flatMap(({point}) => [...point, 0]));
    append('steps_at', walks.steps.flatMap((step) => [...step.normal, step.girthInverse, ...step.joint, step.seamRadius, step.bone, step.before, step.same, 0]));
    append('motions_at', isPosed ? motions(bind, this.pose).flat() : []);
    this.setTexture('tables', 'float', Float32Array.from(values), TABLE_WIDTH);
    this.tablesAt = at;
    this.isPosed = isPosed;
  }

  run() {
    const gl = this.gl, count = this.lattice.vertexCount;
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    gl.useProgram(this.program);
    ['tables', 'texels', 'transfer_moves', 'places', 'rings'].forEach((name, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.textures[name]);
      gl.uniform1i(this.at(name), unit);
    });
    for (const [name, value] of Object.entries(this.tablesAt)) gl.uniform1i(this.at(name), value);
    gl.uniform1i(this.at('inner_count'), this.lattice.innerCount);
    gl.uniform1i(this.at('is_posed'), this.isPosed ? 1 : 0);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, this.points);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 1, this.normals);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, count);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 1, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
  }

  /** The drawn points, relative to the model's origin, read back from the GPU. @returns {Float32Array} */
  positions() {
    if (this.readBack) return this.readBack;
    const gl = this.gl;
    this.readBack = new Float32Array(3 * this.lattice.vertexCount);
    gl.bindBuffer(gl.COPY_READ_BUFFER, this.points);
    gl.getBufferSubData(gl.COPY_READ_BUFFER, 0, this.readBack);
    gl.bindBuffer(gl.COPY_READ_BUFFER, null);
    return this.readBack;
  }

  /** Texels as they are shown, four floats each. */
  shownTexels() {
    const level = this.level, values = this.texels.slice();
    for (const bone of this.state.transferred) {
      const [x, y, width, height] = level.patches[bone];
      for (let row = y; row < y + height; ++row)
        for (let k = 4 * (row * level.width + x), end = k + 4 * width; k < end; ++k)
          values[k] += (1 - this.state.t) * level.transfer.values[k];
    }
    return values;
  }
}
