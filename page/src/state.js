// SPDX-License-Identifier: MIT
// The state in the address: #mode=checker&size=128&t=0.4&pose=BONE:x,y,z,w;..&transfer=BONE,..&view=..&up=z&skeleton=0
import {MODES} from './picture.js';
import {normalized} from './vector.js';

/**
 * @typedef {object} Shown
 * @property {string} mode @property {number} level @property {number} t
 * @property {Map<number, number[]>} rotations @property {Set<number>} transferred
 * @property {string} view @property {string} up @property {boolean} hasSkeleton
 */

/** @param {Shown} shown @returns {string} only what differs from the page as it opens, but the view */
export function write(model, shown) {
  const name = (bone) => encodeURIComponent(model.skeleton.bones[bone].name);
  const parts = [];
  if (shown.mode !== 'shaded') parts.push(`mode=${shown.mode}`);
  if (shown.level > 0) parts.push(`size=${sizeOf(model.levels[shown.level])}`);
  if (shown.t > 0) parts.push(`t=${+shown.t.toFixed(3)}`);
  if (shown.rotations.size > 0)
    parts.push('pose=' + [...shown.rotations].map(([bone, q]) => `${name(bone)}:${q.map((x) => +x.toFixed(5)).join(',')}`).join(';'));
  if (shown.transferred.size > 0) parts.push('transfer=' + [...shown.transferred].map(name).join(','));
  if (shown.up !== model.up) parts.push(`up=${shown.up}`);
  if (!shown.hasSkeleton) parts.push('skeleton=0');
  if (shown.view) parts.push(`view=${shown.view}`);
  return '#' + parts.join('&');
}

export const sizeOf = (level) => Math.max(level.width, level.height);

/** @returns {Shown} what an address says, the rest as the page opens; what makes no sense is left out */
export function read(model, hash) {
  const values = new Map(hash.replace(/^#/, '').split('&').map((part) => {
    const at = part.indexOf('=');
    return [part.slice(0, at), part.slice(at + 1)];
  }));
  const bones = new Map(model.skeleton.bones.map((bone, i) => [bone.name, i]));
  const boneOf = (text) => {
    try {
      return bones.get(decodeURIComponent(text));
    } catch {
      return undefined;
    }
  };
  const rotations = new Map();
  for (const turned of (values.get('pose') ?? '').split(';')) {
    const [name, numbers] = turned.split(':'), q = (numbers ?? '').split(',').map(Number);
    if (boneOf(name) !== undefined && q.length === 4 && q.every(Number.isFinite) && Math.hypot(...q) > 0)
      rotations.set(boneOf(name), normalized(q));
  }
  const level = model.levels.findIndex((one) => sizeOf(one) === Number(values.get('size')));
  const t = Number(values.get('t') ?? 0);
  const mode = values.get('mode');
  return {
    mode: MODES.includes(mode) && (mode !== 'error' || model.levels[0].error) ? mode : 'shaded',
    level: Math.max(0, level), t: model.second && t >= 0 && t <= 1 ? t : 0, rotations,
    transferred: new Set(model.second ? (values.get('transfer') ?? '').split(',').map(boneOf).filter((bone) => bone !== undefined) : []),
    view: values.get('view') ?? '', up: ['y', 'z'].includes(values.get('up')) ? values.get('up') : model.up, hasSkeleton: values.get('skeleton') !== '0'
  };
}
