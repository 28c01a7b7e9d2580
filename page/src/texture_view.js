// SPDX-License-Identifier: MIT
// The texture as a picture: along, around, out as red, green, blue, as `skeletex render --mode map` shows it.
import {boneColour, css} from './colours.js';

/** What 99 of 100 values lie below in size. */
function robustSize(texels, channel) {
  const sizes = [];
  for (let i = channel; i < texels.length; i += 4 * 7) sizes.push(Math.abs(texels[i]));
  sizes.sort((a, b) => a - b);
  return Math.max(sizes[Math.floor((sizes.length - 1) * 0.99)], 1e-30);
}

export class TextureView {
  /** @param {HTMLCanvasElement} canvas @param {HTMLCanvasElement} marks */
  constructor(canvas, marks) {
    this.canvas = canvas;
    this.marks = marks;
  }

  /** @param {import('./surface.js').Surface} surface */
  draw(surface) {
    const {level} = surface, texels = surface.shownTexels();
    if (this.canvas.width !== level.width || this.canvas.height !== level.height) {
      this.canvas.width = level.width;
      this.canvas.height = level.height;
    }
    const context = this.canvas.getContext('2d'), image = context.createImageData(level.width, level.height);
    const [along, around, out] = [0, 1, 2].map((channel) => robustSize(texels, channel));
    for (let i = 0; i < image.data.length; i += 4) {
      image.data[i] = 127.5 + 127.5 * texels[i] / along;
      image.data[i + 1] = 127.5 + 127.5 * texels[i + 1] / around;
      image.data[i + 2] = 255 * texels[i + 2] / out;
      image.data[i + 3] = 255;
    }
    context.putImageData(image, 0, 0);
    this.level = level;
  }

  /** Outlines patches, and marks a place. @param {{bone: number, row: number, column: number} | null} at */
  mark(at, transferred) {
    const {canvas, marks, level} = this, scale = Math.min(2, devicePixelRatio);
    marks.width = Math.round(canvas.clientWidth * scale);
    marks.height = Math.round(canvas.clientHeight * scale);
    const context = marks.getContext('2d'), k = marks.width / level.width;
    level.patches.forEach(([x, y, width, height], bone) => {
      const isLit = at?.bone === bone, isTransferred = transferred.has(bone);
      context.lineWidth = (isLit || isTransferred ? 2 : 1) * scale;
      context.strokeStyle = isLit ? '#ff9d3f' : isTransferred ? css(boneColour(bone)) : 'rgb(255 255 255 / 35%)';
      const inset = context.lineWidth / 2;
      context.strokeRect(x * k + inset, y * k + inset, width * k - 2 * inset, height * k - 2 * inset);
    });
    if (!at) return;
    const [x, y, , height] = level.patches[at.bone];
    context.beginPath();
    context.arc((x + at.column + 0.5) * k, (y + Math.min(at.row + 0.5, height - 0.5)) * k, 5 * scale, 0, 2 * Math.PI);
    context.lineWidth = 4 * scale;
    context.strokeStyle = 'rgb(0 0 0 / 60%)';
    context.stroke();
    context.lineWidth = 2 * scale;
    context.strokeStyle = '#ffffff';
    context.stroke();
  }

  /** @returns {[number, number]} the texel under a pointer */
  texelAt(event) {
    const box = this.canvas.getBoundingClientRect();
    return [Math.floor((event.clientX - box.left) / box.width * this.level.width), Math.floor((event.clientY - box.top) / box.height * this.level.height)];
  }
}
