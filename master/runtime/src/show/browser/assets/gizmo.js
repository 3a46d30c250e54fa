// What is drawn over the picture: the selection's box, arrows to drag it by, a ring to turn it by, and the lamps.

import { changePlace, thing } from "./pieces.js";
import { add, apply, dot, length, lens, middle, rotated, scale, scaled, sub, unit } from "./vector.js";

const AXES = [[[1, 0, 0], "#ff6b6b"], [[0, 1, 0], "#7bd88f"], [[0, 0, 1], "#6cb6ff"]];
const EDGES = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
const ARM_PX = 78;
/** How near to a lamp's marker a click means it: under a mouse, and under a finger. */
const NEAR_PX = { mouse: 11, pen: 14, touch: 20 };

export class Gizmo {
  /** `place` gives the picture's rectangle on the screen; `edit(changes, gesture)` acts; `dropped` is called when a grip
   *  is let go. */
  constructor(svg, { place, edit, dropped, enabled }) {
    Object.assign(this, { svg, place, edit, dropped, enabled });
    this.gesture = Date.now();
    /** Markers of lamps are wanted; those of lamps that are behind something, by number; the keys of lamps that are chosen. */
    Object.assign(this, { markers: true, hidden: new Set(), chosen: new Set() });
  }

  /** Draws for a camera, a scene and a selection or null: `{ kind: "object" | "light", index }`, or a piece of an object. */
  draw(camera, scene, selection) {
    Object.assign(this, { camera, scene, selection });
    if (!camera || !scene) return;
    const l = (this.lens = lens(camera));
    const parts = [];
    this.screen = (p) => {
      const seen = l.project(p);
      const r = this.place();
      return seen && { x: r.x + seen.x * r.width, y: r.y + seen.y * r.height, depth: seen.depth };
    };
    const isChosen = (index) => (selection?.kind === "light" && selection.index === index) || this.chosen?.has(`light ${index}`);
    // Behind a wall, or not wanted: only what is selected keeps its marker.
    this.lamps = scene.lights.flatMap((light, index) => {
      const place = position(light), at = place && (isChosen(index) || (this.markers && !this.hidden.has(index))) && this.screen(place);
      return at ? [{ index, ...at }] : [];
    });
    for (const { index, x, y } of this.lamps) {
      const chosen = isChosen(index);
      parts.push(`<circle class="lamp ${chosen ? "chosen" : ""}" data-light="${index}" cx="${x}" cy="${y}" r="9"/>`);
    }
    parts.push(this.box(thing(scene, selection)));
    const pivot = this.pivot();
    const centre = pivot && this.screen(pivot);
    if (centre && this.enabled()) parts.push(this.arms(pivot, centre, selection.kind));
    this.svg.innerHTML = parts.join("");
    this.svg.querySelectorAll("[data-grab]").forEach((part) => part.addEventListener("pointerdown", (e) => this.grab(e, part.dataset.grab)));
  }

  /** The lamp whose marker is there, if one is; the nearest of several. Markers leave drags, pinches and the wheel to the
   *  picture that they lie on. */
  lampAt(clientX, clientY, pointer) {
    const r = this.svg.getBoundingClientRect();
    const away = ({ x, y }) => Math.hypot(x - (clientX - r.left), y - (clientY - r.top));
    const near = (this.lamps ?? []).filter((lamp) => away(lamp) <= (NEAR_PX[pointer] ?? NEAR_PX.mouse));
    const nearest = near.sort((a, b) => away(a) - away(b))[0];
    return nearest ? { kind: "light", index: nearest.index } : null;
  }

  /** The point that the selection is moved by; nothing of what is nowhere. */
  pivot(scene = this.scene, selection = this.selection) {
    const object = thing(scene, selection);
    if (object?.box) return apply(object.place, middle(object.box[0], object.box[1]));
    const light = selection?.kind === "light" && scene.lights[selection.index];
    return light ? position(light) : null;
  }

  box(object) {
    if (!object?.box) return "";
    const corners = [...Array(8).keys()].map((i) => this.screen(apply(object.place, [0, 1, 2].map((a) => object.box[(i >> a) & 1][a]))));
    const lines = EDGES.filter(([a, b]) => corners[a] && corners[b]);
    const path = lines.map(([a, b]) => `M${corners[a].x} ${corners[a].y}L${corners[b].x} ${corners[b].y}`).join("");
    return `<path class="box" d="${path}"/>`;
  }

  arms(pivot, centre, kind) {
    const reach = this.unitLength(centre);
    const arms = AXES.map(([axis, colour], i) => {
      const tip = this.screen(add(pivot, scale(axis, reach)));
      if (!tip) return "";
      const line = `x1="${centre.x}" y1="${centre.y}" x2="${tip.x}" y2="${tip.y}"`;
      return `<line class="axis" stroke="${colour}" ${line}/><circle cx="${tip.x}" cy="${tip.y}" r="6" fill="${colour}"/><line class="hit grab" data-grab="${i}" ${line}/>`;
    });
    const extra = kind === "light" ? "" :
      `<circle class="grab" data-grab="turn" cx="${centre.x}" cy="${centre.y}" r="${ARM_PX * 0.62}" fill="none" stroke="#ffb454" stroke-opacity=".8" stroke-width="3" stroke-dasharray="4 5"><title>Turn about the vertical</title></circle>` +
      `<rect class="grab" data-grab="size" x="${centre.x + ARM_PX * 0.44 - 6}" y="${centre.y + ARM_PX * 0.44 - 6}" width="12" height="12" rx="2" fill="#ffb454"><title>Scale</title></rect>`;
    return extra + arms.join("") + `<circle class="grab" data-grab="free" cx="${centre.x}" cy="${centre.y}" r="9" fill="#fff" fill-opacity=".85" stroke="#000" stroke-opacity=".4"><title>Move in the picture's plane</title></circle>`;
  }

  /** Length in the scene that is an arm on the screen, at a depth. */
  unitLength({ depth }) { return (ARM_PX / this.place().height) * this.camera.height * this.lens.pixel * depth; }

  grab(e, what) {
    e.preventDefault();
    e.stopPropagation();
    const gesture = ++this.gesture;
    const finger = e.pointerId;
    const start = { x: e.clientX, y: e.clientY };
    const pivot = this.pivot();
    const centre = this.screen(pivot);
    const selection = this.selection;
    const before = structuredClone(thing(this.scene, selection)?.place ?? this.scene.lights[selection.index]);
    const perPixel = this.unitLength(centre) / ARM_PX;
    const { right, down } = this.lens;
    const up = unit(this.camera.up);
    const axis = AXES[what]?.[0];
    const tip = axis && this.screen(add(pivot, scale(axis, this.unitLength(centre))));
    const move = (e) => {
      if (e.pointerId !== finger) return;
      const [dx, dy] = [e.clientX - start.x, e.clientY - start.y];
      if (what === "turn" || what === "size") {
        const from = [start.x - centre.x, start.y - centre.y], to = [e.clientX - centre.x, e.clientY - centre.y];
        const sign = dot(up, this.lens.forward) > 0 ? 1 : -1;
        const angle = sign * (Math.atan2(to[1], to[0]) - Math.atan2(from[1], from[0]));
        const factor = Math.max(0.05, Math.hypot(...to) / Math.max(1, Math.hypot(...from)));
        return this.put(selection, what === "turn" ? rotated(before, up, angle, pivot) : scaled(before, factor, pivot), gesture);
      }
      let by = add(scale(right, dx * perPixel), scale(down, dy * perPixel));
      if (axis) {
        const [ax, ay] = [tip.x - centre.x, tip.y - centre.y];
        by = scale(axis, ((dx * ax + dy * ay) / Math.max(25, ax * ax + ay * ay)) * this.unitLength(centre));
      }
      this.put(selection, shifted(before, by), gesture);
    };
    const up_ = (e) => { if (e.pointerId !== finger) return; removeEventListener("pointermove", move); removeEventListener("pointerup", up_); removeEventListener("pointercancel", up_); this.dropped(); };
    addEventListener("pointermove", move);
    addEventListener("pointerup", up_);
    addEventListener("pointercancel", up_);
  }

  /** A step by a key: to the right, up, away, about the vertical, or larger; `way` is 1, or -1 for the other way. */
  nudge(what, way, again) {
    const pivot = this.selection && this.enabled() && this.pivot();
    const centre = pivot && this.screen(pivot);
    if (!centre) return;
    const before = structuredClone(thing(this.scene, this.selection)?.place ?? this.scene.lights[this.selection.index]);
    if (!again) this.gesture += 1;
    const { right, down, forward } = this.lens;
    const by = { right, up: scale(down, -1), away: forward }[what];
    if (by) this.put(this.selection, shifted(before, scale(by, (way * this.unitLength(centre)) / 8)), this.gesture);
    else if (this.selection.kind !== "light") {
      const value = what === "turn" ? rotated(before, unit(this.camera.up), (way * Math.PI) / 36, pivot) : scaled(before, 1.05 ** way, pivot);
      this.put(this.selection, value, this.gesture);
    }
    this.dropped();
  }

  /** Moves what is selected by so much, in a step of its own. */
  shift(selection, by) {
    const before = structuredClone(thing(this.scene, selection)?.place ?? this.scene.lights[selection.index]);
    this.put(selection, shifted(before, by), ++this.gesture);
    this.dropped();
  }

  put(selection, value, gesture) {
    const change = selection.kind === "light" ? { Light: { light: selection.index, value } } : changePlace(this.scene, selection, value);
    this.edit([change], gesture);
  }
}

/** Where a lamp is; a distant one is nowhere. */
export function position({ Point, Spot, Luminaire }) {
  return (Point ?? Spot ?? Luminaire)?.position ?? null;
}

function shifted(before, by) {
  if (before.translation) return { ...before, translation: add(before.translation, by) };
  const [kind] = Object.keys(before);
  return { [kind]: { ...before[kind], position: add(before[kind].position, by) } };
}

/** A ball around an object or lamp, as centre and radius; nothing around what is nowhere. */
export function ball(scene, selection, otherwise) {
  if (selection.kind === "light") {
    const at = position(scene.lights[selection.index]);
    return at && [at, otherwise];
  }
  const object = thing(scene, selection);
  if (!object?.box) return null;
  const [a, b] = object.box.map((corner) => apply(object.place, corner));
  return [middle(a, b), Math.max(1e-4, length(sub(a, b)) / 2)];
}
