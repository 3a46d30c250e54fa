// The panel: what is selected, as sliders; how it is shown; how the machine is.

import { changeMaterial, changeVisible, findPiece, isLifted, isSame, madeOf, putBack, thing } from "./pieces.js";
import { hueOf, kelvinOf, KELVIN, luminance, measures, ofKelvin } from "./light.js";
import { ms, short, si } from "./number.js";
import { entry, quantity } from "./units.js";
import { angles, direction, hex, unhex } from "./vector.js";

const el = (tag, properties = {}, ...children) => {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
};

/** A labelled slider, and a field beside it to type into; `change(value)` while it moves. `log`: equal steps are equal
 *  factors, and what is typed may go beyond the slider. `units`, `shown`: what the field understands. */
export function slider(label, value, { min, max, step = "any", log = false, units = {}, shown = "" }, change) {
  const to = (v) => (log ? Math.log10(Math.max(v, min)) : v), from = (v) => (log ? 10 ** v : v);
  const read = (v) => (log && v < min ? "off" : quantity(v, units, shown));
  const input = el("input", { type: "range", min: to(min), max: to(Math.max(max, value)), step, value: to(value), ariaLabel: label });
  const field = entry(label, value, { units, shown, read, min: log ? 0 : min, max: log ? Infinity : max }, (v) => { input.value = to(v); change(v); });
  input.oninput = () => { const v = from(+input.value), sent = log && v <= min * 1.01 ? 0 : v; field.show(sent); change(sent); };
  return el("div", { className: "row" }, el("span", { textContent: label, title: label }), input, field);
}

function colour(label, rgb, change, note = "") {
  const input = el("input", { type: "color", value: hex(rgb), ariaLabel: label });
  input.oninput = () => change(unhex(input.value));
  return el("div", { className: "row" }, el("span", { textContent: label }), input, typeof note === "string" ? el("small", { className: "hint", textContent: note }) : note);
}

/** A colour of light: picked, or typed as the temperature of the black body of that colour. */
function lightColour(label, hue, pick, typed) {
  const kelvin = kelvinOf(hue);
  const read = (k) => (k > 0 ? quantity(Math.round(k / 10) * 10, { K: 1 }, "K") : "no K");
  const field = entry("Temperature", kelvin ?? 0, { units: { K: 1 }, shown: "K", min: KELVIN[0], max: KELVIN[1], read, title: `Colour temperature, ${KELVIN[0]} to ${KELVIN[1]} K: the lamp stays as bright` }, (k) => typed(ofKelvin(k)));
  return colour(label, hue, pick, field);
}

/** The highlights of what its index of refraction says. */
const whole = { amount: { value: 1, texture: null }, colour: { value: [1, 1, 1], texture: null } };

const SURFACES = {
  Diffuse: (m) => ({ albedo: albedo(m) }),
  Glossy: (m) => ({ base: albedo(m), roughness: { value: 0.35, texture: null }, metalness: { value: 0, texture: null }, f0: 0.04, specular: whole, sheen: null, coat: null }),
  Mirror: () => ({ reflectance: [0.9, 0.9, 0.9] }),
  Dielectric: () => glass(),
  Glazed: (m) => ({ amount: { value: 0.5, texture: null }, glass: glass({ thin: true }), base: albedo(m), metalness: { value: 0, texture: null }, f0: 0.04, specular: whole }),
  Translucent: (m) => ({ albedo: half(albedo(m)), transmittance: half(albedo(m)) }),
};
const SURFACE_NAMES = { Diffuse: "Matte", Glossy: "Glossy", Mirror: "Mirror", Dielectric: "Glass", Glazed: "Half glass", Translucent: "Paper" };

const glass = (other) => ({ ior: 1.5, transmittance: { value: [1, 1, 1], texture: null }, roughness: { value: 0, texture: null }, absorption: [0, 0, 0], thin: false, priority: 0, ...other });
const half = (c) => ({ ...c, value: c.value.map((v) => v / 2) });

function albedo({ surface: { Diffuse, Glossy, Glazed, Translucent } }) {
  return Diffuse?.albedo ?? Glossy?.base ?? Glazed?.base ?? Translucent?.albedo ?? { value: [0.7, 0.7, 0.7], texture: null };
}

/** Controls for a material; `change(material)` gets a new one. */
export function materialControls(material, textures, change, off) {
  const [kind] = Object.keys(material.surface);
  const surface = material.surface[kind];
  const put = (part) => change({ ...material, surface: { [kind]: { ...surface, ...part } } });
  const textured = (c) => (c?.texture != null ? `× ${textures[c.texture] ?? "texture"}` : "");
  const rows = [];
  const choice = el("select", { ariaLabel: "Surface" }, ...Object.keys(SURFACES).map((k) => el("option", { value: k, textContent: SURFACE_NAMES[k], selected: k === kind })));
  choice.onchange = () => change({ ...material, surface: { [choice.value]: SURFACES[choice.value](material) } });
  rows.push(el("label", { className: "row" }, el("span", { textContent: "Surface" }), choice));
  if (kind === "Diffuse") rows.push(colour("Colour", surface.albedo.value, (value) => put({ albedo: { ...surface.albedo, value } }), textured(surface.albedo)));
  if (kind === "Glossy") {
    rows.push(colour("Colour", surface.base.value, (value) => put({ base: { ...surface.base, value } }), textured(surface.base)));
    rows.push(slider("Roughness", surface.roughness.value, { min: 0, max: 1 }, (value) => put({ roughness: { ...surface.roughness, value } })));
    rows.push(slider("Metalness", surface.metalness.value, { min: 0, max: 1 }, (value) => put({ metalness: { ...surface.metalness, value } })));
    const { specular } = surface;
    const highlight = (part) => put({ specular: { ...specular, ...part } });
    rows.push(slider("Highlight", specular.amount.value, { min: 0, max: 1 }, (value) => highlight({ amount: { ...specular.amount, value } })));
    rows.push(colour("Highlight colour", specular.colour.value, (value) => highlight({ colour: { ...specular.colour, value } }), textured(specular.colour)));
    const sheen = surface.sheen ?? { colour: { value: [0, 0, 0], texture: null }, roughness: { value: 0.5, texture: null } };
    const tint = (value) => put({ sheen: Math.max(...value) > 0 ? { ...sheen, colour: { ...sheen.colour, value } } : null });
    const strength = Math.max(...sheen.colour.value);
    rows.push(slider("Sheen", strength, { min: 0, max: 1 }, (v) => tint((strength > 0 ? hueOf(sheen.colour.value) : [1, 1, 1]).map((part) => part * v))));
    if (surface.sheen) {
      rows.push(colour("Sheen colour", sheen.colour.value, tint, textured(sheen.colour)));
      rows.push(slider("Sheen's roughness", sheen.roughness.value, { min: 0, max: 1 }, (value) => put({ sheen: { ...sheen, roughness: { ...sheen.roughness, value } } })));
    }
    const coat = surface.coat ?? { amount: { value: 0, texture: null }, roughness: { value: 0, texture: null } };
    rows.push(slider("Lacquer", coat.amount.value, { min: 0, max: 1 }, (value) => put({ coat: value > 0 ? { ...coat, amount: { ...coat.amount, value } } : null })));
    if (surface.coat) rows.push(slider("Lacquer's roughness", coat.roughness.value, { min: 0, max: 1 }, (value) => put({ coat: { ...coat, roughness: { ...coat.roughness, value } } })));
  }
  if (kind === "Mirror") rows.push(colour("Colour", surface.reflectance, (reflectance) => put({ reflectance })));
  const panes = (it, putGlass) => {
    rows.push(slider("Refraction", it.ior, { min: 1, max: 2.5 }, (ior) => putGlass({ ior: Math.max(1, ior) })));
    rows.push(slider("Roughness", it.roughness.value, { min: 0, max: 1 }, (value) => putGlass({ roughness: { ...it.roughness, value } })));
    rows.push(colour("Tint", it.transmittance.value, (value) => putGlass({ transmittance: { ...it.transmittance, value } }), textured(it.transmittance)));
  };
  if (kind === "Dielectric") panes(surface, put);
  if (kind === "Glazed") {
    rows.push(slider("Glass", surface.amount.value, { min: 0, max: 1 }, (value) => put({ amount: { ...surface.amount, value } })));
    rows.push(colour("Colour", surface.base.value, (value) => put({ base: { ...surface.base, value } }), textured(surface.base)));
    panes(surface.glass, (part) => put({ glass: { ...surface.glass, ...part } }));
  }
  if (kind === "Translucent") {
    rows.push(colour("Colour", surface.albedo.value, (value) => put({ albedo: { ...surface.albedo, value } }), textured(surface.albedo)));
    rows.push(colour("Let through", surface.transmittance.value, (value) => put({ transmittance: { ...surface.transmittance, value } }), textured(surface.transmittance)));
  }
  const most = Math.max(...material.emission.value);
  const hue = () => hueOf(most > 0 ? material.emission.value : off.value);
  const shine = (colour, power) => change({ ...material, emission: { ...material.emission, value: colour.map((v) => v * power) } });
  rows.push(slider("Glow", most, { min: 0.01, max: Math.max(100, most * 10), log: true, ...measures(null, hue()) }, (power) => shine(hue(), power)));
  if (most > 0) {
    rows.push(lightColour("Glow colour", hue(), (colour) => shine(colour, most), (colour) => shine(colour, (most * luminance(hue())) / luminance(colour))));
    if (textured(material.emission)) rows.push(el("p", { className: "hint", textContent: textured(material.emission) }));
  }
  return rows;
}

/** Controls for a lamp without surface. `up`: the upright, that its direction is turned about. `off`: its colour while it
 *  is off, and how to keep another. */
export function lightControls(light, solids, up, change, off) {
  const [kind] = Object.keys(light);
  const value = light[kind];
  const field = kind === "Directional" ? "irradiance" : "intensity";
  const most = Math.max(...value[field]);
  const hue = () => hueOf(most > 0 ? value[field] : off.value);
  const put = (part) => change({ [kind]: { ...value, ...part } });
  const shine = (colour, power) => put({ [field]: colour.map((v) => v * power) });
  const on = el("input", { type: "checkbox", checked: most > 0, id: "lamp-on" });
  on.onchange = () => put({ [field]: on.checked ? off.value : [0, 0, 0] });
  const rows = [
    el("label", { className: "row check", title: "Turned on again, it is as it was" }, on, el("span", { textContent: "On" })),
    slider("Power", most, { min: 1e-3, max: Math.max(1000, most * 30), log: true, ...measures(light, hue(), solids) }, (power) => shine(hue(), power)),
    lightColour("Colour", hue(), (colour) => (most > 0 ? shine(colour, most) : off.keep(colour.map((v) => v * Math.max(...off.value)))),
      (colour) => {
        const power = (rgb) => (Math.max(...rgb) * luminance(hueOf(rgb))) / luminance(colour);
        if (most > 0) shine(colour, power(value[field]));
        else off.keep(colour.map((v) => v * power(off.value)));
      }),
  ];
  if (value.direction) {
    const [about, above] = angles(value.direction, up);
    rows.push(slider("Turn °", about, { min: -180, max: 180, units: { "°": 1 } }, (deg) => put({ direction: direction([deg, above], up) })));
    rows.push(slider("Tilt °", above, { min: -90, max: 90, units: { "°": 1 } }, (deg) => put({ direction: direction([about, deg], up) })));
  }
  if (kind === "Spot") {
    const degrees = (cos) => (Math.acos(cos) * 180) / Math.PI, cosine = (deg) => Math.cos((deg * Math.PI) / 180);
    rows.push(slider("Cone °", degrees(value.cos_outer), { min: 2, max: 89, units: { "°": 1 } }, (deg) => put({ cos_outer: cosine(deg), cos_inner: cosine(Math.min(degrees(value.cos_inner), deg * 0.95)) })));
    rows.push(slider("Sharp °", degrees(value.cos_inner), { min: 1, max: 88, units: { "°": 1 } }, (deg) => put({ cos_inner: cosine(Math.min(deg, degrees(value.cos_outer) * 0.98)) })));
  }
  return rows;
}

const LENGTHS = { m: 1, cm: 0.01, mm: 0.001, ft: 0.3048, in: 0.0254 };

/** Where the middle of the selection is, typed; a unit of length takes the scene's own for metres. */
function placeControls(at, shift) {
  const fields = ["x", "y", "z"].map((name, axis) => {
    const field = entry(`Place ${name}`, at[axis], { units: LENGTHS, read: (v) => short(v, 4), title: `${name}; type a number, or one with a unit: ${Object.keys(LENGTHS).join(", ")}` },
      (value) => shift([0, 1, 2].map((other) => (other === axis ? value - at[axis] : 0))));
    return field;
  });
  return el("div", { className: "row place" }, el("span", { textContent: "At" }), ...fields);
}

/** Fills the section of the selection. `act`: edit(changes, gesture), gesture(), again(selection), up(), pivot(selection),
 *  shift(selection, by). */
export function showSelection(node, scene, selection, act) {
  if (!selection) {
    node.replaceChildren(el("p", { className: "hint", textContent: "Click something in the picture, or a lamp, to move it and to change what it is made of. Shift click: the whole object that it belongs to, or a piece of it." }));
    return;
  }
  const { kind, index } = selection, at = act.pivot(selection);
  const place = at ? [placeControls(at, (by) => act.shift(selection, by))] : [];
  if (kind === "light") {
    const light = scene.lights[index];
    const gesture = act.gesture();
    node.replaceChildren(el("p", { className: "title", textContent: lampName(scene, index) }),
      ...(light.Luminaire ? [el("p", { className: "hint", textContent: scene.textures[light.Luminaire.solid] ?? "" })] : []), ...lightControls(light, scene.solids, act.up(), (value) => act.edit([{ Light: { light: index, value } }], gesture), act.hue("lights", index)), ...place);
    return;
  }
  const object = thing(scene, selection);
  const rows = [el("p", { className: "title", textContent: object?.name || `Object ${index + 1}` })];
  if (kind === "piece") {
    const whole = el("button", { id: "whole", textContent: `All of ${scene.objects[selection.object]?.name || "it"}`, title: "Select the whole object (Shift click)" });
    whole.onclick = () => act.again({ kind: "object", index: selection.object, material: selection.material });
    const back = el("button", { id: "back", textContent: "Put back", title: "As it is in the file", disabled: !object || !isLifted(findPiece(scene, selection)) });
    back.onclick = () => { act.edit(putBack(scene, selection), act.gesture()); act.again(selection); };
    rows.push(el("div", { className: "chips" }, whole, back));
  }
  const visible = el("input", { type: "checkbox", checked: object?.visible });
  visible.onchange = () => act.edit([changeVisible(selection, visible.checked)]);
  rows.push(el("label", { className: "row check" }, visible, el("span", { textContent: "Visible" })), ...place);
  const materials = object?.materials ?? [];
  const current = materials.includes(selection.material) ? selection.material : materials[0];
  if (materials.length > 1) {
    const choice = el("select", { ariaLabel: "Material" }, ...materials.map((m) => el("option", { value: m, textContent: scene.materials[m]?.name || `material ${m}`, selected: m === current })));
    choice.onchange = () => act.again({ ...selection, material: +choice.value });
    rows.push(el("label", { className: "row" }, el("span", { textContent: "Material" }), choice));
  } else if (scene.materials[current]?.name) {
    rows.push(el("p", { className: "hint", textContent: scene.materials[current].name }));
  }
  if (scene.materials[current]) {
    const gesture = act.gesture();
    const change = (value) => changeMaterial(selection, current, value);
    const { OwnMaterial: own } = change(null);
    const alone = madeOf(scene, own.object, own.piece, current), shared = scene.materials[current], has = alone !== shared;
    // What nothing else is made of needs no second one. Of pieces, nobody knows here.
    const others = kind === "piece" || has || scene.objects.some((other, i) => i !== index && other.materials.includes(current));
    if (others) {
      const all = el("input", { type: "checkbox", checked: selection.alike === true, id: "alike" });
      all.onchange = () => act.again({ ...selection, alike: all.checked });
      rows.push(el("label", { className: "row check", title: "What is changed here is changed of all things of this material, but for those that have their own" }, all, el("span", { textContent: "All that are made of this" })));
    }
    if (has) {
      const like = el("button", { id: "like-others", textContent: "Like the others", title: "Takes its own material away" });
      // The button goes: no other is to have its keys.
      like.onclick = () => { like.blur(); act.edit([change(null)]); act.again(selection); };
      rows.push(el("div", { className: "chips" }, like));
    }
    const alike = !others || selection.alike === true;
    rows.push(...(alike
      ? materialControls(shared, scene.textures, (value) => act.edit([{ Material: { material: current, value } }], gesture), act.hue("materials", current))
      : materialControls(alone, scene.textures, (value) => act.edit([change(value)], gesture), act.ownHue(own))));
  }
  node.replaceChildren(...rows);
}

/** Lists all things that can be selected without pointing at them. */
export function showThings(node, scene, selection, choose) {
  const item = (it, name) => {
    const button = el("button", { textContent: name, ariaPressed: String(isSame(it, selection)) });
    button.onclick = () => choose(it);
    return button;
  };
  const lifted = scene.pieces.filter(isLifted).map(({ object, piece }) => ({ kind: "piece", object, piece }));
  node.replaceChildren(
    ...scene.objects.slice(0, 500).map((object, i) => item({ kind: "object", index: i }, `${glows(scene, object) ? "☀" : "◻"} ${object.name || "object " + (i + 1)}`)),
    ...lifted.map((it) => item(it, `↗ ${thing(scene, it).name}${thing(scene, it).visible ? "" : " (hidden)"}`)));
}

/** A lamp's name in its file; one is made up only where there is none. */
export const lampName = ({ lights, light_names: names }, i) => names[i] || `${Object.keys(lights[i])[0]} lamp ${i + 1}`;

const glows = (scene, object) => object.materials?.some((m) => Math.max(...((object.own.find(([of]) => of === m)?.[1] ?? scene.materials[m])?.emission.value ?? [0])) > 0);

/** Controls for what can be set of a method; `turn(name, value)` while one is turned, and each control's `show(value)` shows
 *  how it is, unless somebody holds it. */
export function methodControls(method, turn) {
  return method.knobs.map((knob) => {
    const { name, label, about: title, kind } = knob, id = `knob-${name}`;
    const free = (node) => document.activeElement !== node || node.type === "checkbox";
    if (kind === "switch") {
      const input = el("input", { id, type: "checkbox", onchange: () => turn(name, input.checked) });
      input.show = (on) => { input.checked = on; };
      return el("label", { className: "row check", title }, input, el("span", { textContent: label }));
    }
    if (kind === "choice") {
      const options = knob.words.map(([word, about]) => el("option", { value: word, textContent: word, title: about }));
      const choice = el("select", { id, ariaLabel: label, onchange: () => turn(name, choice.value) }, ...options);
      choice.show = (word) => { if (free(choice)) choice.value = word; };
      return el("label", { className: "row", title }, el("span", { textContent: label }), choice);
    }
    const { least: min, most: max, step } = knob.slider, out = el("output");
    const input = el("input", { id, type: "range", min, max, step, oninput: () => { out.textContent = short(input.value); turn(name, +input.value); } });
    input.show = (value) => { if (free(input)) [input.value, out.textContent] = [value, short(value)]; };
    return el("label", { className: "row", title }, el("span", { textContent: label }), input, out);
  });
}

/** Figures, and the workers. `seen`: what this page measured itself. */
export function showStats(stats, list, status, header, seen) {
  const rows = [
    ["Frames/s", seen.rate.toFixed(1)],
    ["Latency", `${ms(seen.latency)}`],
    ["… master p50", ms(status.latency_ms[0])],
    ["… master p99", ms(status.latency_ms[1])],
    ["Accumulated", header ? `${header.frames} frames${header.finished ? ", done" : ""}` : "–"],
    ["Error (relMSE)", status.error == null ? "–" : status.error.toExponential(1)],
    ["Size drawn", header ? `${header.width} × ${header.height}` : "–"],
    ["Rays", si(status.rays_per_second, "ray/s")],
    ["From workers", si(status.answer_bytes_per_second, "B/s")],
    ["To this page", si(seen.bytes, "B/s")],
  ];
  stats.replaceChildren(...rows.flatMap(([name, value]) => [el("dt", { textContent: name }), el("dd", { textContent: value })]));
  list.replaceChildren(...status.workers.map((w) => {
    const doing = w.progress ? `fetching ${w.progress[0]}/${w.progress[1]}` : w.state;
    return el("li", {}, el("span", { className: `dot ${w.state}` }), el("span", { textContent: `${w.name} · ${w.threads} threads` }), el("small", { textContent: doing }));
  }));
  if (status.workers.length === 0) list.replaceChildren(el("li", {}, el("span", { className: "dot lost" }), el("span", { textContent: "No worker has come yet" })));
}

/** What the colours mean. */
export function showLegend(node, legend) {
  node.hidden = !legend;
  if (!legend) return;
  const parts = [el("div", { textContent: legend.title })];
  if (legend.to != null) {
    const number = (v) => `${short(v)} ${legend.unit}`;
    const middle = legend.logarithmic ? Math.sqrt(legend.from * legend.to) : (legend.from + legend.to) / 2;
    parts.push(el("div", { className: `ramp ${legend.ramp}` }), el("div", { className: "ends" }, ...[legend.from, middle, legend.to].map((v) => el("span", { textContent: number(v) }))));
  }
  node.replaceChildren(...parts);
}

export { el };
