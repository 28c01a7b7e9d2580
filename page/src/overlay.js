// SPDX-License-Identifier: MIT
// The skeleton and the marked point over the picture.
import {Vector3} from 'three';

export class Overlay {
  /** @param {HTMLCanvasElement} canvas @param {import('three').Camera} camera */
  constructor(canvas, camera) {
    this.canvas = canvas;
    this.camera = camera;
    /** Places of the nodes in CSS pixels. @type {number[][]} */
    this.nodes = [];
  }

  /** @returns {number[]} a point's place in CSS pixels, and its depth */
  project(point) {
    const p = new Vector3(...point).project(this.camera);
    return [(p.x + 1) / 2 * this.canvas.clientWidth, (1 - p.y) / 2 * this.canvas.clientHeight, p.z];
  }

  /**
   * @param {{bones: {head: number, tail: number}[], nodes: number[][], names: string[], movable: boolean[], hasSkeleton: boolean,
   *     joint: number, mark: number[] | null, isDark: boolean}} shown
   */
  draw(shown) {
    const {canvas} = this, scale = Math.min(2, devicePixelRatio), context = canvas.getContext('2d');
    const width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    this.nodes = shown.nodes.map((node) => this.project(node));
    if (shown.hasSkeleton) this.drawSkeleton(context, shown);
    if (shown.mark) this.drawMark(context, this.project(shown.mark));
  }

  drawSkeleton(context, {bones, movable, joint, names, isDark}) {
    const line = isDark ? 'rgb(255 255 255 / 75%)' : 'rgb(30 36 44 / 70%)', around = isDark ? 'rgb(0 0 0 / 45%)' : 'rgb(255 255 255 / 65%)';
    context.lineCap = 'round';
    for (const [width, colour] of [[4.5, around], [2, line]]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.beginPath();
      for (const {head, tail} of bones) {
        context.moveTo(this.nodes[head][0], this.nodes[head][1]);
        context.lineTo(this.nodes[tail][0], this.nodes[tail][1]);
      }
      context.stroke();
    }
    this.nodes.forEach(([x, y], node) => {
      context.beginPath();
      context.arc(x, y, node === joint ? 7 : movable[node] ? 4.5 : 3, 0, 2 * Math.PI);
      context.fillStyle = node === joint ? '#f08a24' : movable[node] ? (isDark ? '#e8ecf0' : '#ffffff') : line;
      context.fill();
      context.lineWidth = 1.5;
      context.strokeStyle = isDark ? '#20242a' : '#2b323a';
      context.stroke();
    });
    if (joint < 0) return;
    const [x, y] = this.nodes[joint], text = names[joint] || `node ${joint}`;
    context.font = '600 12.5px system-ui, "DejaVu Sans", sans-serif';
    const width = context.measureText(text).width;
    const left = Math.min(Math.max(8, x + 14), this.canvas.clientWidth - width - 16), top = Math.max(8, y - 28);
    context.fillStyle = isDark ? 'rgb(20 23 27 / 88%)' : 'rgb(255 255 255 / 92%)';
    context.beginPath();
    context.roundRect(left - 6, top, width + 12, 22, 5);
    context.fill();
    context.fillStyle = isDark ? '#e6e8eb' : '#1d2126';
    context.fillText(text, left, top + 15.5);
  }

  drawMark(context, [x, y]) {
    for (const [width, colour] of [[4, 'rgb(0 0 0 / 60%)'], [2, '#ffffff']]) {
      context.beginPath();
      context.arc(x, y, 6, 0, 2 * Math.PI);
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.stroke();
    }
  }

  /** @returns {number} the movable node near a place, -1: none */
  nodeAt(x, y, movable, reach) {
    let found = -1, best = reach;
    this.nodes.forEach((node, i) => {
      const distance = Math.hypot(node[0] - x, node[1] - y);
      if (movable[i] && distance < best) [found, best] = [i, distance];
    });
    return found;
  }
}
