// SPDX-License-Identifier: MIT
// The picture of the surface, drawn with three.js from the buffers that surface.js has filled.
import {BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, FloatType, GLBufferAttribute, GLSL3, LinearFilter, Mesh,
        NearestFilter, PerspectiveCamera, RawShaderMaterial, RedFormat, Scene, Sphere, WebGLRenderer} from 'three';
import {boneColour, viridis} from './colours.js';
import {array} from './data.js';
import fragment from './draw.frag.glsl';
import vertex from './draw.vert.glsl';

export const MODES = ['shaded', 'segments', 'checker', 'error', 'normals'];
const CELLS = 32;  // across the texture

function colourTexture(colours, filter) {
  const texture = new DataTexture(Uint8Array.from(colours.flatMap((colour) => [...colour, 255])), colours.length, 1);
  texture.minFilter = texture.magFilter = filter;
  texture.needsUpdate = true;
  return texture;
}

function floatTexture(values) {
  const texture = new DataTexture(Float32Array.from(values), values.length, 1, RedFormat, FloatType);
  texture.minFilter = texture.magFilter = NearestFilter;
  texture.needsUpdate = true;
  return texture;
}

export class Picture {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas, bones) {
    const context = canvas.getContext('webgl2', {antialias: true, alpha: false, powerPreference: 'high-performance'});
    if (!context) throw new Error('This browser has no WebGL 2, which the page needs.');
    this.renderer = new WebGLRenderer({canvas, context});
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.gl = context;
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(28, 1, 0.01, 100);
    const error = Array.from({length: 64}, (_, i) => viridis((i + 0.5) / 64));
    this.uniforms = {
      mode: {value: 0}, lit_bone: {value: -1}, clay: {value: new Color()}, clay_dark: {value: new Color()},
      bone_colours: {value: colourTexture(Array.from({length: bones}, (_, i) => boneColour(i)), NearestFilter)},
      error_colours: {value: colourTexture(error, LinearFilter)}, bone_cells: {value: null}
    };
    const material = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: `precision highp float;\n${vertex}`, fragmentShader: `precision highp float;\nprecision highp int;\n${fragment}`,
      uniforms: this.uniforms, side: DoubleSide
    });
    this.mesh = new Mesh(new BufferGeometry(), material);
    this.mesh.frustumCulled = false;
    this.scene.add(this.mesh);
  }

  /** @param {import('./surface.js').Surface} surface */
  setLattice(surface) {
    const {lattice, level} = surface, gl = this.gl, count = lattice.vertexCount;
    for (const name of ['position', 'normal']) this.mesh.geometry.deleteAttribute(name);  // the surface's, which stay
    this.mesh.geometry.dispose();
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new GLBufferAttribute(surface.points, gl.FLOAT, 3, 4, count));
    geometry.setAttribute('normal', new GLBufferAttribute(surface.normals, gl.FLOAT, 3, 4, count));
    const cellSize = Math.max(level.width, level.height) / CELLS;
    const around = level.patches.map(([, , width]) => 2 * Math.max(1, Math.round(width / cellSize / 2)));
    const along = level.patches.map(([, , , height]) => Math.max(2, Math.round(height / cellSize)));
    const cells = new Float32Array(2 * count), patches = new Float32Array(count);
    for (let i = 0; i < count; ++i) {
      const patch = lattice.patches[i], [, , width, height] = level.patches[patch];
      cells[2 * i] = lattice.places[4 * i + 1] / (height - 1) * along[patch];
      cells[2 * i + 1] = lattice.columns[i] / width;
      patches[i] = patch;
    }
    geometry.setAttribute('cell', new BufferAttribute(cells, 2));
    geometry.setAttribute('patch_of', new BufferAttribute(patches, 1));
    geometry.setAttribute('error', new BufferAttribute(this.errors(surface), 1));
    geometry.setIndex(new BufferAttribute(lattice.triangles, 1));
    geometry.boundingSphere = new Sphere();  // unknown here, and not used
    this.mesh.geometry = geometry;
    this.uniforms.bone_cells.value?.dispose();
    this.uniforms.bone_cells.value = floatTexture(around);
  }

  /** Distances to the reference in units of the scale; 0 where there is none. */
  errors(surface) {
    const {lattice, level} = surface, values = new Float32Array(lattice.vertexCount);
    if (!level.error) return values;
    const low = array(surface.arrays, level.error.low), high = array(surface.arrays, level.error.high);
    for (let i = 0; i < values.length; ++i) {
      const at = i < lattice.innerCount ? i : lattice.innerCount + lattice.sources[i - lattice.innerCount];
      values[i] = (low[at] + 256 * high[at]) / 65535 * level.error.highest / level.error.scale;
    }
    return values;
  }

  setTheme(isDark) {
    this.scene.background = new Color(isDark ? '#15171b' : '#f4f5f7');
    this.uniforms.clay.value.set(isDark ? '#c9c6c0' : '#d6d2cb');
    this.uniforms.clay_dark.value.set(isDark ? '#3d5a80' : '#3d5a80');
  }

  resize(width, height) {
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
  }

  render() {
    this.renderer.resetState();
    this.renderer.render(this.scene, this.camera);
  }
}
