// SPDX-License-Identifier: MIT
// The page that `skeletex view` writes: what is shown, and the controls.
import {Vector3} from 'three';
import {boneColour, css} from './colours.js';
import {Parts} from './data.js';
import {Gestures} from './gestures.js';
import {bindKeys} from './keys.js';
import {Orbit} from './orbit.js';
import {Overlay} from './overlay.js';
import {pick, vertexAt} from './pick.js';
import {MODES, Picture} from './picture.js';
import {turnedTowards} from './skeleton.js';
import {read, sizeOf, write} from './state.js';
import {Surface} from './surface.js';
import {TextureView} from './texture_view.js';
import {about, add, between, rotate, scaled, sub, unit} from './vector.js';

/** @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);
const MODE_NAMES = {shaded: 'Shaded', segments: 'Segments', checker: 'Checker', error: 'Error', normals: 'Normals'};

class Page {
  /** @param {any} model @param {ArrayBuffer} arrays those of the coarsest level; finer ones follow (load) */
  constructor(model, arrays) {
    this.model = model;
    this.finest = model.levels.length - 1;
    this.picture = new Picture(element('picture'), model.skeleton.bones.length);
    this.surface = new Surface(this.picture.gl, model, arrays);
    this.orbit = new Orbit(this.picture.camera, model.diagonal, model.front);
    this.overlay = new Overlay(element('overlay'), this.picture.camera);
    this.textureView = new TextureView(element('texture'), element('marks'));
    this.shown = read(model, location.hash);
    this.marked = null;
    this.joint = -1;
    this.isPicking = false;
    this.isDark = matchMedia('(prefers-color-scheme: dark)');
    /** The bone that turns when a node is dragged: the one that ends there. */
    this.linkTo = new Map();
    for (const link of this.surface.links) {
      const {head, tail} = model.skeleton.bones[link.bone];
      if (link.isPosable) this.linkTo.set(link.pivot === 0 ? tail : head, link);
    }
    this.movable = model.skeleton.nodes.map((_, node) => this.linkTo.has(node));
  }

  start() {
    const {model} = this;
    document.title = model.second ? `${model.name} and ${model.second} · Skeletex` : `${model.name} · Skeletex`;
    element('title').textContent = model.second ? `${model.name} → ${model.second}` : model.name;
    this.makeControls();
    this.resize();
    this.orbit.up = this.shown.up;
    element('up').textContent = `Up: ${this.shown.up}`;
    this.change({level: this.shown.level, t: this.shown.t, rotations: this.shown.rotations, transferred: this.shown.transferred}, true);
    this.orbit.fit(this.surface.positions());
    if (this.shown.view) this.orbit.read(this.shown.view);
    this.setMode(this.shown.mode);
    new Gestures(this);
    bindKeys(this);
    this.isDark.addEventListener('change', () => this.render());
    new ResizeObserver(() => this.resize()).observe(element('stage'));
    addEventListener('hashchange', () => this.follow(location.hash));
    this.picture.gl.canvas.addEventListener('webglcontextlost', () => this.say('The browser has taken the graphics context back. Reload the page.'));
    this.render();
    this.textureView.mark(null, this.shown.transferred);
    element('message').hidden = true;
  }

  say(text) {
    element('message').textContent = text;
    element('message').hidden = false;
  }

  makeControls() {
    const {model, shown} = this;
    for (const mode of MODES) {
      const button = document.createElement('button');
      button.type = 'button';
      button.id = `mode-${mode}`;
      button.textContent = MODE_NAMES[mode];
      button.setAttribute('role', 'radio');
      if (mode === 'error' && !model.levels[0].error) {
        button.disabled = true;
        button.title = 'The page knows no mesh to compare with: skeletex view --against MESH';
      }
      button.addEventListener('click', () => this.setMode(mode));
      element('modes').append(button);
    }
    const level = element('level');
    level.max = model.levels.length - 1;
    level.disabled = model.levels.length === 1;
    level.addEventListener('input', () => this.change({level: model.levels.length - 1 - Number(level.value)}));
    element('skeleton').addEventListener('click', () => this.toggleSkeleton());
    element('unpose').addEventListener('click', () => this.change({rotations: new Map()}));
    element('save-pose').addEventListener('click', () => this.savePose());
    element('home').addEventListener('click', () => this.resetView());
    element('up').addEventListener('click', () => this.setUp(this.orbit.up === 'y' ? 'z' : 'y'));
    element('save').addEventListener('click', () => this.savePicture());
    element('skeleton').setAttribute('aria-pressed', shown.hasSkeleton);
    if (!this.movable.includes(true)) element('pose-hint').textContent = 'All bones are in cycles, so they cannot be turned here.';
    const texture = element('texture');
    texture.addEventListener('pointermove', (event) => this.pointAtTexel(...this.textureView.texelAt(event)));
    texture.addEventListener('pointerdown', (event) => this.pointAtTexel(...this.textureView.texelAt(event)));
    texture.addEventListener('pointerleave', () => this.mark(null));
    if (model.second) this.makeSecondControls();
  }

  makeSecondControls() {
    const {model} = this, refused = new Map(model.levels[0].transfer.refused.map(({bone, why}) => [bone, why]));
    element('morph').hidden = element('transfer').hidden = false;
    element('first-name').textContent = model.name;
    element('second-name').textContent = element('source-name').textContent = model.second;
    element('t').addEventListener('input', () => {
      this.stop();
      this.change({t: Number(element('t').value)});
    });
    element('play').addEventListener('click', () => (this.playing ? this.stop() : this.play()));
    element('pick').addEventListener('click', () => {
      this.isPicking = !this.isPicking;
      element('pick').setAttribute('aria-pressed', this.isPicking);
      element('picture').classList.toggle('picking', this.isPicking);
    });
    element('untransfer').addEventListener('click', () => this.change({transferred: new Set()}));
    model.skeleton.bones.forEach((bone, i) => {
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = bone.name || `bone ${i}`;
      button.disabled = refused.has(i);
      button.title = refused.get(i) ?? '';
      button.addEventListener('click', () => this.toggleTransfer(i));
      button.addEventListener('pointerenter', () => this.light(i));
      button.addEventListener('pointerleave', () => this.light(-1));
      element('bones').append(button);
    });
    this.canTake = (bone) => !refused.has(bone);
  }

  /**
   * Changes what the surface depends on: level, t, rotations, transferred. A level that is not loaded yet is shown when
   * it comes, and until then the finest one that is there.
   */
  change(change, isFirst = false) {
    const {shown, surface, model} = this, before = {...surface.state};
    Object.assign(shown, change);
    const isNewLattice = surface.update({...change, level: Math.max(shown.level, this.finest)});
    if (isNewLattice) this.picture.setLattice(surface);
    if (isFirst || ['level', 't', 'transferred'].some((key) => surface.state[key] !== before[key])) this.textureView.draw(surface);
    const level = surface.level, {triangles} = surface.lattice;
    element('level').value = model.levels.length - 1 - surface.state.level;
    element('level').setAttribute('aria-valuetext', `${level.width} by ${level.height} texels`);
    element('level-value').textContent = `${level.width} × ${level.height}`;
    element('facts').textContent = `${level.width} × ${level.height} texels · ${(triangles.length / 3).toLocaleString('en')} triangles`;
    element('unpose').disabled = element('save-pose').disabled = shown.rotations.size === 0;
    if (model.second) {
      element('t').value = shown.t;
      element('t-value').textContent = `t = ${shown.t.toFixed(2)}`;
      element('untransfer').disabled = shown.transferred.size === 0;
      [...element('bones').children].forEach((button, bone) => {
        const isOn = shown.transferred.has(bone);
        button.setAttribute('aria-pressed', isOn);
      });
    }
    if (!isFirst) this.mark(null);
    this.showScale();
    this.render();
    this.remember();
  }

  setMode(mode) {
    if (mode === 'error' && !this.model.levels[0].error) return;
    this.shown.mode = mode;
    this.picture.uniforms.mode.value = MODES.indexOf(mode);
    for (const other of MODES) element(`mode-${other}`).setAttribute('aria-checked', other === mode);
    this.showScale();
    this.render();
    this.remember();
  }

  showScale() {
    const error = this.surface.level.error;
    element('scale').hidden = this.shown.mode !== 'error';
    if (error) element('highest').textContent = `${error.scale.toExponential(1)} of the diagonal`;
  }

  toggleSkeleton() {
    this.shown.hasSkeleton = !this.shown.hasSkeleton;
    element('skeleton').setAttribute('aria-pressed', this.shown.hasSkeleton);
    this.joint = -1;
    this.render();
    this.remember();
  }

  toggleTransfer(bone) {
    if (!this.model.second || !this.canTake(bone)) return;
    const transferred = new Set(this.shown.transferred);
    if (!transferred.delete(bone)) transferred.add(bone);
    this.change({transferred});
  }

  setUp(up) {
    this.orbit.up = this.shown.up = up;
    element('up').textContent = `Up: ${up}`;
    this.resetView(true);
  }

  /** Shows finer levels as they come. @param {Parts} parts @param {Uint8Array} arrays @param {number} at bytes that are there */
  async load(parts, arrays, at) {
    while (this.finest > 0) {
      do {
        const part = await parts.next();
        arrays.set(new Uint8Array(part), at);
        at += part.byteLength;
        --this.finest;
      } while (parts.hasNext && this.finest > 0);
      if (this.surface.state.level <= this.shown.level) continue;
      this.change({});
      if (!this.shown.view) this.orbit.fit(this.surface.positions());
    }
    this.draw();
  }

  resetView(isRefit = false) {
    this.orbit.reset();
    if (isRefit) this.orbit.fit(this.surface.positions());
    this.shown.view = '';
    this.render();
    this.remember();
  }

  /** After the view was turned. */
  viewChanged() {
    this.shown.view = this.orbit.text();
    this.render();
    this.remember();
  }

  // Posing

  /** Turns the bone that ends at a joint so that the joint comes near a place in the picture. */
  dragJoint(node, x, y) {
    const {surface} = this, link = this.linkTo.get(node);
    if (!link) return;
    const {head, tail} = this.model.skeleton.bones[link.bone], pivot = link.pivot === 0 ? head : tail;
    const from = surface.pose.nodes[pivot], at = surface.pose.nodes[node];
    const ray = this.rayAt(x, y), normal = this.viewDirection();
    const depth = sub(at, ray.origin).reduce((sum, v, i) => sum + v * normal[i], 0) / ray.direction.reduce((sum, v, i) => sum + v * normal[i], 0);
    const target = add(ray.origin, scaled(ray.direction, depth));
    if (Math.hypot(...sub(target, from)) < 1e-6 * this.model.diagonal) return;
    this.turnBone(link, between(unit(sub(at, from)), unit(sub(target, from))));
  }

  /** Turns the bone that ends at a joint about an axis of the view. */
  turnJoint(node, axis, degrees) {
    const link = this.linkTo.get(node);
    if (link) this.turnBone(link, about(this.viewAxis(axis), degrees * Math.PI / 180));
  }

  turnBone(link, turn) {
    const rotations = new Map(this.shown.rotations);
    rotations.set(link.bone, turnedTowards(this.surface.bind, this.surface.pose, link, turn));
    this.change({rotations});
  }

  viewAxis(column) {
    return new Vector3().setFromMatrixColumn(this.picture.camera.matrixWorld, column).toArray();
  }
  viewDirection() { return scaled(this.viewAxis(2), -1); }

  rayAt(x, y) {
    const {camera} = this.picture, canvas = element('overlay');
    const far = new Vector3(2 * x / canvas.clientWidth - 1, 1 - 2 * y / canvas.clientHeight, 0.5).unproject(camera).toArray();
    const origin = camera.position.toArray();
    return {origin, direction: unit(sub(far, origin))};
  }

  /** The joint after the chosen one, in the order of the nodes. */
  nextJoint(step) {
    const nodes = this.movable.flatMap((isMovable, node) => (isMovable ? [node] : []));
    if (nodes.length === 0) return;
    const at = nodes.indexOf(this.joint);
    this.chooseJoint(nodes[(at + step + nodes.length) % nodes.length]);
  }

  chooseJoint(node) {
    if (node === this.joint) return;
    this.joint = node;
    this.render();
  }

  // Pointing

  pointAt(x, y) {
    const {origin, direction} = this.rayAt(x, y);
    this.mark(pick(this.surface, origin, direction));
  }

  pointAtTexel(x, y) {
    const at = vertexAt(this.surface, x, y);
    if (at) at.point = Array.from(this.surface.positions().subarray(3 * at.vertex, 3 * at.vertex + 3));
    this.mark(at);
  }

  /** Shows a place on the surface and in the texture. */
  mark(at) {
    this.marked = at;
    this.picture.uniforms.lit_bone.value = at ? at.bone : -1;
    this.textureView.mark(at, this.shown.transferred);
    if (at) {
      const {level} = this.surface, [x, y, width, height] = level.patches[at.bone];
      element('texel').textContent = `${Math.min(x + Math.floor(at.column), x + width - 1)}, ${y + Math.round(at.row)}`;
      const error = level.error && this.shown.mode === 'error' ? this.errorAt(at.vertex) : null;
      element('status').textContent = `${this.model.skeleton.bones[at.bone].name || `bone ${at.bone}`} · row ${Math.round(at.row)} of ${height} · column ${Math.floor(at.column)} of ${width}` +
          (error === null ? '' : ` · ${error.toExponential(1)} of the diagonal from the mesh`);
    } else {
      element('texel').textContent = element('status').textContent = '';
    }
    this.render();
  }

  errorAt(vertex) {
    return this.picture.mesh.geometry.getAttribute('error').getX(vertex) * this.surface.level.error.scale;
  }

  light(bone) {
    this.picture.uniforms.lit_bone.value = bone;
    this.render();
  }

  // Time

  play() {
    element('play').textContent = 'Stop';
    const start = performance.now(), from = this.shown.t >= 1 ? 0 : this.shown.t;
    const frame = (now) => {
      if (!this.playing) return;
      const phase = (from + Math.max(0, now - start) / 4000) % 2;
      this.change({t: phase <= 1 ? phase : 2 - phase});
      this.playing = requestAnimationFrame(frame);
    };
    this.playing = requestAnimationFrame(frame);
  }

  stop() {
    if (this.playing) cancelAnimationFrame(this.playing);
    this.playing = 0;
    element('play').textContent = 'Play';
  }

  // Files

  download(name, blob) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  savePicture() {
    this.draw();
    const {canvas} = this.picture.gl, both = document.createElement('canvas');
    [both.width, both.height] = [canvas.width, canvas.height];
    const context = both.getContext('2d');
    context.drawImage(canvas, 0, 0);
    context.drawImage(element('overlay'), 0, 0, both.width, both.height);
    both.toBlob((blob) => this.download(`${this.model.name}.png`, blob));
  }

  /** The pose as `skeletex reconstruct --pose` reads it. */
  poseJson() {
    const rotations = {};
    for (const [bone, q] of this.shown.rotations) rotations[this.model.skeleton.bones[bone].name] = {quaternion: q};
    return JSON.stringify({rotations}, null, 1);
  }

  savePose() {
    this.download(`${this.model.name}_pose.json`, new Blob([this.poseJson() + '\n'], {type: 'application/json'}));
  }

  // The address

  remember() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      this.ownHash = write(this.model, this.shown);
      if (location.protocol !== 'about:') history.replaceState(null, '', this.ownHash);  // in a notebook's frame
    }, 150);
  }

  /** Shows what an address says. */
  follow(hash) {
    if (hash === this.ownHash) return;
    const next = read(this.model, hash);
    this.shown.hasSkeleton = next.hasSkeleton;
    element('skeleton').setAttribute('aria-pressed', next.hasSkeleton);
    if (next.up !== this.orbit.up) this.setUp(next.up);
    this.change({level: next.level, t: next.t, rotations: next.rotations, transferred: next.transferred});
    if (next.view) {
      this.orbit.read(next.view);
      this.viewChanged();
    }
    this.setMode(next.mode);
  }

  // Drawing

  resize() {
    const {clientWidth, clientHeight} = element('overlay');
    this.picture.resize(Math.max(1, clientWidth), Math.max(1, clientHeight));
    this.orbit.apply();
    if (this.textureView.level) this.textureView.mark(this.marked, this.shown.transferred);
    this.render();
  }

  /** Draws before the browser shows the next frame. */
  render() {
    this.frame ||= requestAnimationFrame(() => this.draw());
  }

  draw() {
    if (this.frame) cancelAnimationFrame(this.frame);
    this.frame = 0;
    if (!this.surface.pose) return;
    this.picture.setTheme(this.isDark.matches);
    this.picture.render();
    this.overlay.draw({
      bones: this.model.skeleton.bones, nodes: this.surface.pose.nodes, names: this.model.skeleton.nodes, movable: this.movable,
      hasSkeleton: this.shown.hasSkeleton, joint: this.joint, mark: this.marked?.point ?? null, isDark: this.isDark.matches
    });
    this.firstFrame ??= performance.now();
  }
}

const parts = new Parts();

/** Shows the coarsest level as soon as it is loaded. `whole` is kept when the finest one is. */
async function open() {
  const model = JSON.parse(new TextDecoder().decode(await parts.next())), arrays = new Uint8Array(model.bytes);
  const coarsest = new Uint8Array(await parts.next());
  arrays.set(coarsest);
  const page = new Page(model, arrays.buffer);
  page.start();
  page.draw();
  page.whole = page.load(parts, arrays, coarsest.length);
  page.whole.catch((error) => page.say(`This page is shown as far as it was loaded: ${error.message}`));
  return page;
}

/** What tests and scripts of a page can use: the page once its coarsest level is shown. */
globalThis.skeletex = open().catch((error) => {
  element('message').textContent = `This page cannot be shown: ${error.message}`;
  element('message').hidden = false;
  throw error;
});
