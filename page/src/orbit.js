// SPDX-License-Identifier: MIT
// A camera that turns about a target.
import {Matrix4, Vector3} from 'three';

const FIT = 1.12;

export class Orbit {
  /**
   * @param {import('three').PerspectiveCamera} camera @param {number} size diagonal of what is shown
   * @param {number} front angle about up that shows its front
   */
  constructor(camera, size, front) {
    this.camera = camera;
    this.size = size;
    this.up = 'y';
    this.home = {azimuth: front + 0.45, elevation: 0.16, distance: 1, target: [0, 0, 0]};
    Object.assign(this, structuredClone(this.home));
  }

  /** Places the camera so that points fill the picture. @param {Float32Array} points */
  fit(points) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < points.length; ++i) {
      low[i % 3] = Math.min(low[i % 3], points[i]);
      high[i % 3] = Math.max(high[i % 3], points[i]);
    }
    this.target = low.map((x, i) => (x + high[i]) / 2);
    this.distance = 1;
    this.apply();
    // The pyramid through a point meets the axis at z + |x| / tan.
    const tanY = Math.tan(this.camera.fov * Math.PI / 360), tanX = tanY * this.camera.aspect;
    const inverse = new Matrix4().copy(this.camera.matrixWorld).invert(), p = new Vector3();
    let farthest = 0;
    for (let i = 0; i < points.length; i += 3) {
      p.set(points[i], points[i + 1], points[i + 2]).applyMatrix4(inverse);
      const depth = p.z + this.distance * this.size;
      farthest = Math.max(farthest, depth + FIT * Math.abs(p.x) / tanX, depth + FIT * Math.abs(p.y) / tanY);
    }
    this.distance = farthest / this.size;
    this.home = structuredClone({azimuth: this.azimuth, elevation: this.elevation, distance: this.distance, target: this.target});
    this.apply();
  }

  reset() {
    Object.assign(this, structuredClone(this.home));
    this.apply();
  }

  apply() {
    const {camera} = this, c = Math.cos(this.elevation), sideways = [c * Math.sin(this.azimuth), Math.sin(this.elevation), c * Math.cos(this.azimuth)];
    // With z up the front is -y, as most tools have it.
    const back = this.up === 'y' ? sideways : [sideways[0], -sideways[2], sideways[1]];
    camera.up.set(0, this.up === 'y' ? 1 : 0, this.up === 'y' ? 0 : 1);
    const distance = this.distance * this.size;
    camera.position.set(...this.target.map((x, i) => x + distance * back[i]));
    camera.lookAt(...this.target);
    camera.near = Math.max(0.002 * this.size, distance - 2 * this.size);
    camera.far = distance + 2 * this.size;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  turn(right, up) {
    this.azimuth -= right;
    this.elevation = Math.min(1.55, Math.max(-1.55, this.elevation + up));
    this.apply();
  }

  zoom(factor) {
    this.distance = Math.min(20, Math.max(0.05, this.distance * factor));
    this.apply();
  }

  /** @param {number} x, y in shares of the picture's height */
  pan(x, y) {
    const scale = 2 * Math.tan(this.camera.fov * Math.PI / 360) * this.distance * this.size;
    const right = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0), up = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 1);
    this.target = this.target.map((v, i) => v - scale * (x * right.getComponent(i) - y * up.getComponent(i)));
    this.apply();
  }

  /** As the address has it: angles in degrees, the rest in diagonals. */
  text() {
    const numbers = [this.azimuth * 180 / Math.PI, this.elevation * 180 / Math.PI, this.distance, ...this.target.map((x) => x / this.size)];
    return numbers.map((x) => +x.toFixed(3)).join(',');
  }

  read(text) {
    const numbers = text.split(',').map(Number);
    if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return;
    this.azimuth = numbers[0] * Math.PI / 180;
    this.elevation = Math.min(1.55, Math.max(-1.55, numbers[1] * Math.PI / 180));
    this.distance = Math.min(20, Math.max(0.05, numbers[2]));
    this.target = numbers.slice(3).map((x) => x * this.size);
    this.apply();
  }
}
