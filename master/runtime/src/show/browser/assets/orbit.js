// Moving the camera: mouse, touch and keys. It only computes; `moved` is told of every new camera, `refused` of what
// somebody does who may not move it.

import { add, cross, dot, length, scale, sub, turn, unit, lens } from "./vector.js";

const CLICK_PX = 4;
const STEEPEST = 0.995;

export class Orbit {
  constructor(canvas, { moved, clicked, hovered, pivotAt, refused, walk }) {
    Object.assign(this, { canvas, moved, refused, walk });
    // Height of the eyes of who walks, in the scene's unit; 0: people fly.
    this.eyes = 0;
    this.mode = "orbit";
    this.pointers = new Map();
    this.keys = new Set();
    // Until the master has said who has the controls.
    this.enabled = false;
    // What lies over the picture and takes hold of the pointer leaves these two to it.
    const stage = canvas.parentElement;

    canvas.addEventListener("pointerdown", (e) => {
      canvas.focus({ preventScroll: true });
      canvas.setPointerCapture(e.pointerId);
      this.pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
      this.travelled = this.pointers.size > 1 ? Infinity : 0;
      this.button = e.button;
      this.pivot = null;
      if (this.pointers.size === 1) pivotAt(e.clientX, e.clientY);
      canvas.classList.add("dragging");
    });
    stage.addEventListener("pointermove", (e) => {
      const was = this.pointers.get(e.pointerId);
      if (!was) return hovered(e.clientX, e.clientY);
      const spread = this.spread();
      const now = { x: e.clientX, y: e.clientY };
      this.pointers.set(e.pointerId, now);
      const [dx, dy] = [now.x - was.x, now.y - was.y];
      this.travelled += Math.abs(dx) + Math.abs(dy);
      if (this.travelled < CLICK_PX) return;
      if (!this.enabled) return refused();
      if (this.pointers.size >= 2) {
        this.pan(dx / this.pointers.size, dy / this.pointers.size);
        const spreadNow = this.spread();
        if (spread > 0 && spreadNow > 0) this.dolly(Math.log(spread / spreadNow));
      } else {
        this.drag(dx, dy, e);
      }
    });
    const up = (e) => {
      if (!this.pointers.delete(e.pointerId)) return;
      if (this.pointers.size === 0) canvas.classList.remove("dragging");
      if (e.type === "pointerup" && this.travelled < CLICK_PX && this.button === 0) clicked(e.clientX, e.clientY, e);
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    stage.addEventListener("wheel", (e) => {
      e.preventDefault();
      if (!this.enabled) return refused();
      this.dolly(Math.max(-0.5, Math.min(0.5, e.deltaY * (e.deltaMode ? 0.04 : 0.0012))));
    }, { passive: false });
    // Who leaves the page with a key held does not walk for ever.
    for (const where of [canvas, window]) where.addEventListener("blur", () => this.keys.clear());
  }

  set(camera) {
    this.camera = { ...camera };
    this.home ??= { ...camera };
    this.up ??= unit(camera.up);
  }

  /** What is upright on the screen: of a plan, not what is upright in the scene. */
  get axis() { return this.camera.cut ? unit(this.camera.up) : this.up; }

  /** What somebody else looks at. */
  follow(camera) {
    this.camera = { ...this.camera, ...camera };
    return this.camera;
  }

  drag(dx, dy, e) {
    const pans = this.camera.cut || this.mode === "pan" || this.button === 2 || e.shiftKey;
    if (pans) this.pan(dx, dy);
    else if (this.mode === "look" || this.button === 1 || e.altKey) this.rotate(-dx, -dy, this.camera.origin, 0.6);
    else this.rotate(-dx, -dy, this.pivot ?? this.camera.target, 1);
  }

  /** Turns eye and target about a pivot; never over the poles. */
  rotate(dx, dy, pivot, speed) {
    // A plan stays one.
    if (this.camera.cut) return;
    const { origin, target } = this.camera;
    const angle = (speed * Math.PI) / Math.max(300, this.canvas.clientHeight);
    const yawed = (p) => add(pivot, turn(sub(p, pivot), this.up, dx * angle));
    const [o, t] = [yawed(origin), yawed(target)];
    const right = unit(cross(unit(sub(t, o)), this.up));
    const pitched = (p) => add(pivot, turn(sub(p, pivot), right, dy * angle));
    const [o2, t2] = [pitched(o), pitched(t)];
    const steep = Math.abs(dot(unit(sub(t2, o2)), this.up)) > STEEPEST;
    this.move(...(steep ? [o, t] : [o2, t2]));
  }

  pan(dx, dy) {
    const l = lens({ ...this.camera, height: this.canvas.clientHeight, width: this.canvas.clientWidth });
    const depth = Math.max(this.reach(), 1e-6) * l.pixel;
    this.shift(add(scale(l.right, -dx * depth), scale(l.down, -dy * depth)));
  }

  /** Nearer to or farther from the pivot by a factor e^amount; through it there is no way. */
  dolly(amount) {
    const { origin, target } = this.camera;
    const step = scale(unit(sub(target, origin)), this.reach() * (1 - Math.exp(amount)));
    const near = length(sub(target, origin)) * Math.exp(amount);
    const o = add(origin, step);
    this.move(o, add(o, scale(unit(sub(target, origin)), Math.max(near, 1e-4))));
  }

  /** How far what people look at is. */
  reach() {
    const { origin, target, cut } = this.camera;
    if (cut) return length(sub(target, origin));
    const forward = unit(sub(target, origin));
    const along = this.pivot ? dot(sub(this.pivot, origin), forward) : 0;
    return along > 0 ? along : length(sub(target, origin));
  }

  shift(by) { this.move(add(this.camera.origin, by), add(this.camera.target, by)); }

  move(origin, target) {
    if (!this.enabled) return this.refused();
    if ( ![...origin, ...target].every(Number.isFinite) || length(sub(target, origin)) < 1e-6) return;
    this.camera = { ...this.camera, origin, target, up: this.axis };
    this.moved(this.camera);
  }

  /** Brings a ball into view. */
  frame(centre, radius) {
    const { origin, target, fov_y_deg } = this.camera;
    const narrow = Math.min(1, this.canvas.clientWidth / this.canvas.clientHeight);
    const distance = (1.25 * radius) / Math.sin((fov_y_deg * Math.PI) / 360) / narrow;
    const forward = unit(sub(target, origin));
    // What is cut stays so.
    const on = this.camera.cut ? add(centre, scale(forward, dot(sub(target, centre), forward))) : centre;
    this.move(sub(on, scale(forward, distance)), on);
  }

  spread() {
    const [a, b] = [...this.pointers.values()];
    return a && b ? Math.hypot(a.x - b.x, a.y - b.y) : 0;
  }

  /** Keys that move while they are held. True if it is one of them. */
  key(e, down) {
    const key = e.key.toLowerCase();
    if (!["w", "a", "s", "d", "q", "e", "arrowleft", "arrowright", "arrowup", "arrowdown"].includes(key)) return false;
    if (down && (e.ctrlKey || e.metaKey)) return false;
    if (down && !this.enabled) { this.refused(); return true; }
    down ? this.keys.add(key) : this.keys.delete(key);
    if (down && !this.flying) this.fly();
    return true;
  }

  /** Asks the master where a step leads; the next one is not asked before. */
  step(by) {
    // Who looks down walks on all the same.
    const level = sub(by, scale(this.up, dot(by, this.up))), far = length(level);
    const wanted = far > 0 ? scale(level, length(by) / far) : level;
    this.wanted = add(this.wanted ?? [0, 0, 0], wanted);
    if (this.walking) return;
    this.walking = true;
    this.walk(this.camera.origin, this.wanted, this.eyes);
    this.wanted = null;
  }

  /** That is where it leads. */
  walked(origin) {
    this.walking = false;
    if (this.eyes > 0 && this.enabled && !this.camera.cut) this.shift(sub(origin, this.camera.origin));
  }

  fly() {
    this.flying = true;
    let last = performance.now();
    const step = (now) => {
      if (this.keys.size === 0 || !this.enabled) { this.flying = false; return; }
      const seconds = Math.min(0.1, (now - last) / 1000);
      last = now;
      const held = (a, b) => (this.keys.has(a) ? 1 : 0) - (this.keys.has(b) ? 1 : 0);
      const { origin, target, cut, fov_y_deg } = this.camera;
      const into = unit(sub(target, origin)), right = unit(cross(into, this.axis));
      // Over a plan people walk across the picture; what would let them rise shifts the cut.
      const [forward, up] = cut ? [this.axis, scale(into, -0.1)] : [into, this.up];
      const far = cut ? 2 * length(sub(target, origin)) * Math.tan((fov_y_deg * Math.PI) / 360) : length(sub(this.home.target, this.home.origin));
      const speed = 0.6 * far * seconds;
      const by = add(add(scale(forward, held("w", "s") * speed), scale(right, held("d", "a") * speed)), scale(up, held("e", "q") * speed));
      if (length(by) > 0) this.eyes > 0 && !cut ? this.step(by) : this.shift(by);
      const [yaw, pitch] = [held("arrowleft", "arrowright"), held("arrowup", "arrowdown")];
      if (yaw || pitch) this.rotate(yaw * 300 * seconds, pitch * 300 * seconds, this.camera.origin, 1);
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
}
