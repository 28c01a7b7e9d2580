// SPDX-License-Identifier: MIT
// The data of the page: JSON and arrays that core/skeletex/page has packed.

/** @typedef {[string, number, number]} Place type, first byte and number of values of an array */

const TYPES = {float: Float32Array, int: Int32Array, byte: Uint8Array};

/** @param {string} base64 @returns {Uint8Array} */
function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** The parts of the page's data, which come while the page is loaded: JSON first, then the arrays of each level. */
export class Parts {
  constructor() {
    this.texts = [];
    this.wake = () => {};
    globalThis.addPart = (base64) => {
      this.texts.push(base64);
      this.wake();
    };
    addEventListener('load', () => {
      this.isLoaded = true;
      this.wake();
    });
  }

  /** Whether the next part is there. */
  get hasNext() { return this.texts.length > 0; }

  /** Waits for the next part. @returns {Promise<ArrayBuffer>} */
  async next() {
    while (!this.hasNext) {
      if (this.isLoaded) throw new Error('its end is missing. Load it again.');
      await new Promise((resolve) => { this.wake = resolve; });
    }
    const stream = new Blob([bytesOf(this.texts.shift())]).stream().pipeThrough(new DecompressionStream('deflate'));
    return new Response(stream).arrayBuffer();
  }
}

/** @param {ArrayBuffer} arrays @param {Place} place */
export function array(arrays, [type, offset, count]) {
  return new TYPES[type](arrays, offset, count);
}

/**
 * Numbers that are stored as steps from the array before (add_steps in core/skeletex/page/pack.h).
 * @param {ArrayBuffer} arrays @param {{step: number, differences: Place}} packed
 * @param {Int32Array} [before] the steps of the array before
 * @returns {{values: Float32Array, steps: Int32Array}}
 */
export function unpackSteps(arrays, packed, before) {
  const bytes = array(arrays, packed.differences), count = bytes.length / 4;
  const values = new Float32Array(count), steps = new Int32Array(count);
  for (let i = 0; i < count; ++i) {
    const code = bytes[i] + 256 * (bytes[count + i] + 256 * (bytes[2 * count + i] + 256 * bytes[3 * count + i]));
    steps[i] = (before ? before[i] : 0) + (code % 2 ? -(code + 1) / 2 : code / 2);
    values[i] = packed.step * steps[i];
  }
  return {values, steps};
}

/** Replaces packed arrays of keys that follow each other by their values. */
export function unpackKeys(arrays, keys, names) {
  for (const name of names) {
    let before;
    for (const key of keys) {
      const {values, steps} = unpackSteps(arrays, key[name], before);
      key[name] = values;
      before = steps;
    }
  }
}

/**
 * The texels of a texture, four floats each: along, around, out, 0.
 * @param {ArrayBuffer} arrays
 * @param {{width: number, height: number, patches: number[][], texels: Place, scales: Place}} texture
 * @returns {Float32Array}
 */
export function unpackTexels(arrays, texture) {
  const bytes = array(arrays, texture.texels), scales = array(arrays, texture.scales);
  const high = bytes.length / 2;
  const texels = new Float32Array(4 * texture.width * texture.height);
  let at = 0, scale = 0;
  for (const [x, y, width, height] of texture.patches) {
    const steps = new Uint16Array(width * height);
    for (let channel = 0; channel < 3; ++channel, scale += 2) {
      for (let row = 0, i = 0; row < height; ++row)
        for (let column = 0; column < width; ++column, ++i, ++at) {
          const code = bytes[at] | (bytes[high + at] << 8);
          const difference = code & 1 ? -((code + 1) >> 1) : code >> 1;
          const guess = row === 0 ? (column === 0 ? 0 : steps[i - 1])
            : column === 0 ? steps[i - width] : steps[i - 1] + steps[i - width] - steps[i - width - 1];
          steps[i] = guess + difference;
          texels[4 * ((y + row) * texture.width + x + column) + channel] = scales[scale] + steps[i] * scales[scale + 1];
        }
    }
  }
  return texels;
}
