// The list of lamps: everything that shines by a name, found by words, in groups, switched and dimmed one by one or together.

import { hueOf, isAbsent, kelvinOf, KELVIN, luminance, measures, ofKelvin, power, skyPower, skyTurn, turnedSky, withPower, withSky } from "./light.js";
import { entry, parse, quantity } from "./units.js";
import { el, lampName, slider } from "./panel.js";
import { ownKey } from "./pieces.js";
import { hex, unhex } from "./vector.js";

const KINDS = { Point: "Points", Spot: "Spots", Luminaire: "Luminaires", Directional: "Suns" };
/** A message of a viewer holds so many lamps. */
export const IN_MESSAGE = 50;
/** So many rows are shown; the search finds the others. */
const ROWS_MAX = 400;

/** All lamps, as `{ key, kind, index, name, light, rgb, off }`: lights, materials that glow or did so before they were turned
 *  off, and the sky. `off`: what it gives when it is turned on again. */
export function lampsOf(scene, hues) {
  const lights = scene.lights.flatMap((light, index) => (isAbsent(light) ? [] : [{
    key: `light ${index}`, kind: "light", index, light, solids: scene.solids, name: lampName(scene, index), rgb: power(light), off: hues.lights[index],
  }]));
  const glowing = scene.materials.flatMap((material, index) => {
    const rgb = material.emission.value, off = hues.materials[index];
    if (!(Math.max(...rgb) > 0) && !off) return [];
    return [{ key: `material ${index}`, kind: "material", index, material, name: material.name || `material ${index + 1}`, rgb, off }];
  });
  const own = [...scene.objects.map((it, object) => ({ it, object, piece: null })), ...scene.pieces.map((it) => ({ it, object: it.object, piece: it.piece }))];
  const alone = own.flatMap(({ it, object, piece }) => it.own.flatMap(([of, material]) => {
    const key = ownKey({ object, piece, material: of }), rgb = material.emission.value, off = hues.own[key];
    if (!(Math.max(...rgb) > 0) && !off) return [];
    const whose = scene.objects[object]?.name || "object " + (object + 1);
    const name = `${material.name || `material ${of + 1}`} (${whose}${piece == null ? "" : `, piece ${piece + 1}`})`;
    return [{ key: `own ${key}`, kind: "own", of: { object, piece, material: of }, material, name, rgb, off }];
  }));
  const sky = scene.environment, rgb = skyPower(sky);
  return [...lights, ...glowing, ...alone, ...(rgb ? [{ key: "sky", kind: "sky", sky, name: "sky", rgb, off: hues.sky }] : [])];
}

/** What a lamp is listed under. */
export const GROUPINGS = {
  name: ["Name", ({ name }) => name.replace(/[\s._#-]*\d+$/, "") || name],
  kind: ["Kind", ({ light, kind }) => (light ? KINDS[Object.keys(light)[0]] : kind === "sky" ? "Sky" : "Surfaces")],
  luminaire: ["Luminaire", ({ light, name }, scene) => (light ? (scene.textures[light.Luminaire?.solid] ?? "No luminaire") : name)],
};

export const isOn = ({ rgb }) => Math.max(...rgb) > 0;
const most = ({ rgb }) => Math.max(...rgb);

/** The change that gives a lamp another power. */
export function lit(lamp, rgb) {
  if (lamp.kind === "light") return { Light: { light: lamp.index, value: withPower(lamp.light, rgb) } };
  if (lamp.kind === "sky") return { Environment: withSky(lamp.sky, rgb) };
  const { material } = lamp;
  if (lamp.kind === "own") return { OwnMaterial: { ...lamp.of, value: { ...material, emission: { ...material.emission, value: rgb } } } };
  return { Material: { material: lamp.index, value: { ...material, emission: { ...material.emission, value: rgb } } } };
}

/** On as it was before it was turned off; white of 1 if nobody has seen it on. */
export const turned = (lamp, on) => lit(lamp, on ? (isOn(lamp) ? lamp.rgb : (lamp.off ?? [1, 1, 1])) : [0, 0, 0]);
/** With the largest channel so. */
const dimmed = (lamp, to) => lit(lamp, hueOf(isOn(lamp) ? lamp.rgb : (lamp.off ?? [1, 1, 1])).map((v) => v * to));
/** Of another colour, and as bright. */
export function coloured(lamp, colour) {
  const rgb = isOn(lamp) ? lamp.rgb : (lamp.off ?? [1, 1, 1]);
  return lit(lamp, colour.map((v) => (v * luminance(rgb)) / Math.max(1e-6, luminance(colour))));
}

/** Makes changes of many lamps, a few in a message, in one step to be undone. */
function editAll(act, changes) {
  const gesture = act.gesture();
  for (let i = 0; i < changes.length; i += IN_MESSAGE) act.edit(changes.slice(i, i + IN_MESSAGE), gesture);
  act.changed();
}

/** Fills the list. `list`: `{ words, by, chosen }`, what is searched for, how it is grouped, the keys of what is chosen.
 *  `act`: edit(changes, gesture), gesture(), changed(), choose(keys). */
export function showLamps(node, scene, hues, list, act) {
  const all = lampsOf(scene, hues);
  const words = list.words.toLowerCase().split(/\s+/).filter(Boolean);
  const found = all.filter(({ name }) => words.every((word) => name.toLowerCase().includes(word)));
  const groups = grouped(found, (lamp) => GROUPINGS[list.by][1](lamp, scene));
  const rows = [];
  const row = (lamps, name, value, level) => {
    const on = lamps.filter(isOn).length;
    const box = el("input", { type: "checkbox", checked: on > 0, indeterminate: on > 0 && on < lamps.length, ariaLabel: `${name}: on` });
    box.onchange = () => editAll(act, lamps.map((lamp) => turned(lamp, box.checked)));
    const keys = lamps.map(({ key }) => key);
    const button = el("button", { title: name, ariaPressed: String(keys.every((key) => list.chosen.has(key))) }, el("span", { textContent: name }), el("small", { textContent: value }));
    button.onclick = (e) => {
      const more = e.ctrlKey || e.metaKey || e.shiftKey;
      if (e.shiftKey && list.last && lamps.length === 1) act.choose(between(found, list.last, keys[0], list.chosen));
      else act.choose(more ? toggled(list.chosen, keys) : new Set(keys));
      list.last = keys[0];
    };
    const isAlone = keys.length === list.solo.keys.length && keys.every((key) => list.solo.keys.includes(key));
    const solo = el("button", { className: "solo", textContent: "S", title: "This alone; once more: all as they were", ariaLabel: `${name}: solo`, ariaPressed: String(isAlone) });
    solo.onclick = () => act.solo(all, keys);
    rows.push(el("div", { className: `lamp-row ${level}` }, el("label", {}, box), button, solo));
  };
  for (const [name, lamps] of groups) {
    if (rows.length > ROWS_MAX) break;
    if (lamps.length > 1) row(lamps, name, `${lamps.length}`, "group-row");
    for (const lamp of lamps.slice(0, ROWS_MAX)) row([lamp], lamp.name, isOn(lamp) ? reading(lamp) : "off", lamps.length > 1 ? "inner" : "");
  }
  const hint = all.length === 0 ? "The scene has no lamps." : "No lamp has such a name.";
  if (rows.length === 0) rows.push(el("p", { className: "hint", textContent: hint }));
  node.replaceChildren(...rows);
}

/** An image of the sky is measured by what it is in the file. */
const measured = (lamp, hue) => (lamp.sky?.Image ? { units: { "×": 1 }, shown: "×" } : measures(lamp.light, hue, lamp.solids));

function reading(lamp) {
  const { units, shown } = measured(lamp, hueOf(lamp.rgb));
  return quantity(most(lamp), units, shown);
}

function grouped(all, of) {
  const groups = new Map();
  for (const it of all) groups.set(of(it), [...(groups.get(of(it)) ?? []), it]);
  return groups;
}

function toggled(chosen, keys) {
  const all = new Set(chosen);
  const remove = keys.every((key) => all.has(key));
  keys.forEach((key) => (remove ? all.delete(key) : all.add(key)));
  return all;
}

function between(found, from, to, chosen) {
  const [a, b] = [from, to].map((key) => found.findIndex((lamp) => lamp.key === key)).sort((a, b) => a - b);
  return new Set([...chosen, ...found.slice(Math.max(0, a), b + 1).map(({ key }) => key)]);
}

/** A slider that dims all together, from what they give when it is taken hold of; a step to be undone each time. */
function dimmer(lamps, act) {
  const range = el("input", { type: "range", min: -2, max: 1, step: "any", value: 0, ariaLabel: "Dim all", title: "From a hundredth to ten times what each gives" });
  let gesture = null;
  const from = lamps.map(most);
  range.oninput = () => {
    gesture ??= act.gesture();
    const changes = lamps.map((lamp, i) => dimmed(lamp, from[i] * 10 ** +range.value));
    for (let i = 0; i < changes.length; i += IN_MESSAGE) act.edit(changes.slice(i, i + IN_MESSAGE), gesture);
  };
  range.onchange = () => act.changed();
  return range;
}

/** Controls for all lamps that are chosen, together. */
export function showChosen(node, scene, hues, list, act) {
  const all = lampsOf(scene, hues), lamps = all.filter(({ key }) => list.chosen.has(key));
  // A light by itself has its own controls, where the selection is.
  if (lamps.length === 0 || (lamps.length === 1 && lamps[0].kind === "light")) return node.replaceChildren();
  const title = lamps.length === 1 ? lamps[0].name : `${lamps.length} lamps`;
  const colour = isOn(lamps[0]) ? lamps[0].rgb : (lamps[0].off ?? [1, 1, 1]);
  const kelvins = lamps.map((lamp) => kelvinOf(isOn(lamp) ? lamp.rgb : (lamp.off ?? [1, 1, 1])));
  const button = (text, title, change) => el("button", { textContent: text, title, onclick: () => editAll(act, change()) });
  const buttons = el("div", { className: "chips" },
    button("On", "As each was before it was turned off", () => lamps.map((lamp) => turned(lamp, true))),
    button("Off", "", () => lamps.map((lamp) => turned(lamp, false))),
    button("Only these", "Turns all other lamps off", () => all.map((lamp) => turned(lamp, list.chosen.has(lamp.key)))));
  // Each lamp reads what is typed in its own measure; a share is of what it gives now.
  const figures = lamps.map((lamp) => measured(lamp, hueOf(isOn(lamp) ? lamp.rgb : (lamp.off ?? [1, 1, 1]))));
  const shown = figures.every(({ shown }) => shown === figures[0].shown) ? figures[0].shown : "%";
  const readings = new Set(lamps.map((lamp) => (isOn(lamp) ? reading(lamp) : "off")));
  const wanted = (text) => lamps.map((lamp, i) => parse(text, { ...figures[i].units, "%": most(lamp) / 100 }, shown));
  const dim = el("input", {
    type: "text", className: "quantity", autocomplete: "off", spellcheck: false, ariaLabel: "Dim all to",
    value: readings.size === 1 ? [...readings][0] : "", placeholder: "each as it is", title: `Type a share, as 40 %, or a quantity: ${Object.keys(figures[0].units).join(", ")}`,
  });
  const was = dim.value;
  dim.oninput = () => { dim.ariaInvalid = String(dim.value !== was && wanted(dim.value).some((to) => !(to >= 0))); };
  dim.onchange = () => {
    const to = wanted(dim.value);
    if (dim.value === was || to.some((value) => !(value >= 0) || value == null)) return act.changed();
    editAll(act, lamps.map((lamp, i) => dimmed(lamp, to[i])));
  };
  const kelvin = entry("Temperature", kelvins[0] ?? 0, { units: { K: 1 }, shown: "K", min: KELVIN[0], max: KELVIN[1], read: (k) => (k > 0 && kelvins.every((other) => other && Math.abs(other - kelvins[0]) < 0.01 * other) ? quantity(Math.round(k / 10) * 10, { K: 1 }, "K") : "–") },
    (k) => editAll(act, lamps.map((lamp) => coloured(lamp, ofKelvin(k)))));
  const pick = el("input", { type: "color", value: hex(hueOf(colour)), ariaLabel: "Colour of all" });
  pick.onchange = () => editAll(act, lamps.map((lamp) => coloured(lamp, unhex(pick.value))));
  node.replaceChildren(el("p", { className: "title", textContent: title }), buttons,
    el("div", { className: "row" }, el("span", { textContent: "Dim to" }), dimmer(lamps.filter(isOn), act), dim),
    el("label", { className: "row" }, el("span", { textContent: "Colour" }), pick, kelvin), ...skyControls(scene, lamps, act));
}

/** Of a sky by itself that is an image: how it is turned, and its suns with it. */
function skyControls(scene, lamps, act) {
  if (lamps.length !== 1 || !lamps[0].sky?.Image) return [];
  const gesture = act.gesture();
  const row = slider("Turn °", skyTurn(scene.environment), { min: -180, max: 180, units: { "°": 1 } }, (deg) => act.edit(turnedSky(scene, deg), gesture));
  row.title = "Where the middle of the image is: degrees from −z towards +x; suns are turned along with it";
  return [row];
}

/** The number that the next lamp has: the first that is free. */
export function nextLamp({ lights }) {
  const free = lights.findIndex(isAbsent);
  return free < 0 ? lights.length : free;
}

/** A name that no lamp has: with the next number behind it. */
function freeName(scene, name) {
  const stem = name.replace(/[\s]*\d+$/, "") || "lamp", taken = new Set(scene.lights.map((_, i) => scene.light_names[i]));
  for (let n = 1; ; n++) if (!taken.has(`${stem} ${n}`)) return `${stem} ${n}`;
}

/** The change that puts a lamp of 800 lm at 2700 K there. */
export function added(scene, position) {
  const colour = ofKelvin(2700), light = { Point: { position, intensity: [0, 0, 0] } };
  const strength = 800 * measures(light, colour).units.lm;
  const value = { name: freeName(scene, "new lamp"), light: withPower(light, colour.map((v) => v * strength)) };
  return { Lamp: { light: nextLamp(scene), value } };
}

/** The change that puts a lamp like another beside it. */
export function duplicated(scene, index, by) {
  const [[kind, value]] = Object.entries(scene.lights[index]);
  const light = { [kind]: value.position ? { ...value, position: value.position.map((v, axis) => v + by[axis]) } : value };
  return { Lamp: { light: nextLamp(scene), value: { name: freeName(scene, lampName(scene, index)), light } } };
}

/** The change that takes a lamp away. */
export const removed = (index) => ({ Lamp: { light: index, value: null } });
