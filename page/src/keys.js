// SPDX-License-Identifier: MIT
// The keyboard.
import {MODES} from './picture.js';

const TURN = 6;  // degrees

/** Keys of controls that have a use of their own for them. */
function isTaken(event) {
  return event.ctrlKey || event.metaKey || event.altKey ||
      (event.target instanceof HTMLInputElement && event.key.startsWith('Arrow'));
}

export function bindKeys(page) {
  const {orbit, shown, model} = page;
  const arrow = (right, up) => {
    if (page.joint >= 0) {
      page.turnJoint(page.joint, up === 0 ? 2 : 0, up === 0 ? -TURN * right : -TURN * up);
    } else {
      orbit.turn(right * TURN * Math.PI / 180, up * TURN * Math.PI / 180);
      page.viewChanged();
    }
  };
  const zoom = (factor) => {
    orbit.zoom(factor);
    page.viewChanged();
  };
  const morph = (step) => {
    if (!model.second) return;
    page.stop();
    page.change({t: Math.min(1, Math.max(0, Math.round(20 * shown.t + step) / 20))});
  };
  const actions = {
    ArrowLeft: () => arrow(-1, 0), ArrowRight: () => arrow(1, 0), ArrowUp: () => arrow(0, 1), ArrowDown: () => arrow(0, -1),
    '+': () => zoom(0.9), '=': () => zoom(0.9), '-': () => zoom(1 / 0.9),
    '[': () => morph(-1), ']': () => morph(1),
    j: () => page.nextJoint(1), J: () => page.nextJoint(-1), Escape: () => page.chooseJoint(-1),
    l: () => page.change({level: (shown.level + 1) % model.levels.length}),
    k: () => page.toggleSkeleton(), r: () => page.change({rotations: new Map()}), p: () => page.savePicture()
  };
  MODES.forEach((mode, i) => { actions[String(i + 1)] = () => page.setMode(mode); });
  addEventListener('keydown', (event) => {
    const action = actions[event.key] ?? actions[event.key.toLowerCase()];
    if (!action || isTaken(event)) return;
    event.preventDefault();
    action();
  });
}
