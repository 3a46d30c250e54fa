// How lamps are, under names, and going from one to the other; and one lamp alone, as long as that is wanted.

import { power, skyPower } from "./light.js";
import { IN_MESSAGE, isOn, lit, turned } from "./lamps.js";
import { el } from "./panel.js";

const SHINERS = { Light: "light", Material: "material" };
const named = (scene, { kind, index, of }) => (kind === "light" ? scene.light_names[index] : kind === "sky" ? "" : kind === "own" ? scene.objects[of.object]?.name : scene.materials[index]?.name) ?? "";

/** The lamp that a state of the master is about, as lampsOf has it; nothing if it is not there. */
function lampOf(scene, state) {
  const of = (lamp) => ({ light: (i) => scene.lights[i] && { kind: "light", index: i, light: scene.lights[i], rgb: power(scene.lights[i]) },
    material: (i) => scene.materials[i] && { kind: "material", index: i, material: scene.materials[i], rgb: scene.materials[i].emission.value } })[lamp];
  if (state.lamp === "Sky") return skyPower(scene.environment) && { kind: "sky", sky: scene.environment, rgb: skyPower(scene.environment) };
  const [[kind, at]] = Object.entries(state.lamp);
  if (kind === "Own") {
    const it = at.piece == null ? scene.objects[at.object] : scene.pieces.find((p) => p.object === at.object && p.piece === at.piece);
    const material = it?.own.find(([instead]) => instead === at.material)?.[1];
    return material && { kind: "own", of: at, material, rgb: material.emission.value };
  }
  const make = of(SHINERS[kind]), here = make(at), name = state.of ?? "";
  if (here && named(scene, here) === name) return here;
  const all = (kind === "Light" ? scene.lights : scene.materials).map((_, i) => make(i)).filter((lamp) => lamp && named(scene, lamp) === name);
  return all.length === 1 ? all[0] : null;
}

/** Goes from what lamps give to what they gave, in so many milliseconds: light adds up, so that powers on the way are mixes of
 *  both. One step to be undone; `done(last)` with each step. Returns what ends it at once. */
export function fade(scene, { lamps }, ms, act) {
  const pairs = lamps.map((state) => ({ lamp: lampOf(scene, state), to: state.power })).filter(({ lamp, to }) => lamp && lamp.rgb.some((v, i) => v !== to[i]));
  const began = performance.now(), gesture = act.gesture();
  let isOver = pairs.length === 0;
  const step = (now) => {
    if (isOver) return;
    const share = ms > 0 ? Math.min(1, Math.max(0, (now - began) / ms)) : 1;
    const changes = pairs.map(({ lamp, to }) => lit(lamp, share === 1 ? to : lamp.rgb.map((v, i) => v + (to[i] - v) * share)));
    for (let i = 0; i < changes.length; i += IN_MESSAGE) act.edit(changes.slice(i, i + IN_MESSAGE), gesture);
    isOver = share === 1;
    if (isOver) act.changed();
    else requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
  return () => { isOver = true; };
}

/** Fills the list of presets; `go(number)`, `forget(number)`. */
export function showPresets(node, presets, go, forget) {
  node.replaceChildren(...presets.map(({ name }, i) => {
    const button = el("button", { textContent: name || `Preset ${i + 1}`, title: "Lamps as they were; Shift click forgets it" });
    button.onclick = (e) => (e.shiftKey ? forget(i) : go(i));
    return button;
  }));
}

/** Lights some lamps alone, or, if they are alone already, the others as they were. `solo`: `{ keys, others }` of what is alone. */
export function toggleSolo(all, keys, solo, act) {
  const isSame = solo.keys.length === keys.length && keys.every((key) => solo.keys.includes(key));
  const others = solo.keys.length > 0 ? solo.others : all.filter(isOn).map(({ key }) => key);
  const wanted = (key) => (isSame ? others.includes(key) : keys.includes(key));
  Object.assign(solo, isSame ? { keys: [], others: [] } : { keys, others });
  const gesture = act.gesture(), changes = all.filter((lamp) => isOn(lamp) !== wanted(lamp.key)).map((lamp) => turned(lamp, wanted(lamp.key)));
  for (let i = 0; i < changes.length; i += IN_MESSAGE) act.edit(changes.slice(i, i + IN_MESSAGE), gesture);
  act.changed();
}
