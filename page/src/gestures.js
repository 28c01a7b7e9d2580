// SPDX-License-Identifier: MIT
// Mouse, pen and touch on the picture.

const CLICK = 5;  // pixels that a click may move

export class Gestures {
  constructor(page) {
    this.page = page;
    this.canvas = document.getElementById('picture');
    /** @type {Map<number, {x: number, y: number}>} */
    this.pointers = new Map();
    this.joint = -1;
    this.canvas.addEventListener('pointerdown', (event) => this.down(event));
    this.canvas.addEventListener('pointermove', (event) => this.move(event));
    for (const name of ['pointerup', 'pointercancel']) this.canvas.addEventListener(name, (event) => this.up(event));
    this.canvas.addEventListener('pointerleave', () => this.pointers.size === 0 && this.leave());
    this.canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    this.canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      page.orbit.zoom(Math.exp(event.deltaY * (event.deltaMode === 1 ? 0.03 : 0.0012)));
      page.viewChanged();
    }, {passive: false});
  }

  placeOf(event) {
    const box = this.canvas.getBoundingClientRect();
    return {x: event.clientX - box.left, y: event.clientY - box.top};
  }

  jointAt(event, {x, y}) {
    const {page} = this;
    if (!page.shown.hasSkeleton || page.isPicking) return -1;
    return page.overlay.nodeAt(x, y, page.movable, event.pointerType === 'mouse' ? 11 : 24);
  }

  down(event) {
    const place = this.placeOf(event);
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, place);
    this.begin = place;
    this.hasMoved = this.pointers.size > 1;
    this.isPan = event.shiftKey || event.button === 1 || event.button === 2;
    this.joint = this.pointers.size === 1 && !this.isPan ? this.jointAt(event, place) : -1;
    if (this.joint >= 0) this.page.chooseJoint(this.joint);
  }

  move(event) {
    const {page} = this, place = this.placeOf(event), last = this.pointers.get(event.pointerId);
    if (!last) {
      this.hover(event, place);
      return;
    }
    if (Math.hypot(place.x - this.begin.x, place.y - this.begin.y) > CLICK) this.hasMoved = true;
    if (!this.hasMoved) return;
    const height = this.canvas.clientHeight, before = [...this.pointers.values()].map((p) => ({...p}));
    this.pointers.set(event.pointerId, place);
    if (this.pointers.size === 2) {
      this.pinch(before, [...this.pointers.values()], height);
      return;
    }
    const right = (place.x - last.x) / height, down = (place.y - last.y) / height;
    if (this.joint >= 0) {
      page.dragJoint(this.joint, place.x, place.y);
    } else {
      if (this.isPan) page.orbit.pan(right, down);
      else page.orbit.turn(4 * right, 4 * down);
      page.viewChanged();
    }
  }

  pinch(before, after, height) {
    const size = ([a, b]) => Math.max(1, Math.hypot(a.x - b.x, a.y - b.y)), middle = ([a, b]) => [(a.x + b.x) / 2, (a.y + b.y) / 2];
    const [x0, y0] = middle(before), [x1, y1] = middle(after);
    this.page.orbit.zoom(size(before) / size(after));
    this.page.orbit.pan((x1 - x0) / height, (y1 - y0) / height);
    this.page.viewChanged();
  }

  up(event) {
    const {page} = this;
    if (!this.pointers.delete(event.pointerId)) return;
    if (!this.hasMoved && event.type === 'pointerup') {
      const place = this.placeOf(event);
      if (this.joint < 0) {
        page.pointAt(place.x, place.y);
        page.chooseJoint(-1);
        if (page.isPicking && page.marked) page.toggleTransfer(page.marked.bone);
      }
    }
    if (this.pointers.size === 0) this.joint = -1;
    else this.hasMoved = true;
  }

  /** Once per frame: looking for the triangle under the cursor takes some milliseconds. */
  hover(event, place) {
    this.hovered = {event, place};
    this.frame ||= requestAnimationFrame(() => {
      this.frame = 0;
      if (!this.hovered || this.pointers.size > 0) return;
      const {page} = this, joint = this.jointAt(this.hovered.event, this.hovered.place);
      this.canvas.classList.toggle('on-joint', joint >= 0);
      if (joint >= 0) page.chooseJoint(joint);
      page.pointAt(this.hovered.place.x, this.hovered.place.y);
    });
  }

  leave() {
    this.hovered = null;
    this.page.mark(null);
  }
}
