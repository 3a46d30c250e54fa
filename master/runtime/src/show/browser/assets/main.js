// The viewer: joins the picture, the pointer, the panel and the way to the master.

import { Link } from "./link.js";
import { Orbit } from "./orbit.js";
import { cutAt, cutOf, perspective, projectionOf, reach, seenAs } from "./projection.js";
import { Gizmo, ball, position } from "./gizmo.js";
import { takeFiles } from "./hang.js";
import { findPiece, learnMaterial, ownKey } from "./pieces.js";
import { learnHue } from "./hues.js";
import { GROUPINGS, added, duplicated, removed, showChosen, showLamps } from "./lamps.js";
import { ABSENT, ev100, isAbsent } from "./light.js";
import { ms, short } from "./number.js";
import { fade, showPresets, toggleSolo } from "./presets.js";
import { el, lampName, showLegend, showSelection, showStats, showThings, methodControls } from "./panel.js";
import { entry, parse } from "./units.js";
import { apply, length, lens, sub } from "./vector.js";

const $ = (id) => document.getElementById(id);
const canvas = $("picture"), context = canvas.getContext("2d", { alpha: false });
const state = { scene: null, selection: null, you: null, holder: null, header: null, camera: null, drawn: 0, hues: { lights: {}, materials: {}, own: {} }, views: [], offer: null, lamps: { words: "", by: "name", chosen: new Set(), solo: { keys: [], others: [] } }, presets: [] };
const seen = { rate: 0, latency: null, bytes: 0 };
window.igi = state;

// ---- the picture on the screen

/** Where the picture lies on the screen: it keeps its shape within the canvas. */
function place() {
  const r = canvas.getBoundingClientRect();
  const s = Math.min(r.width / canvas.width, r.height / canvas.height);
  const [width, height] = [canvas.width * s, canvas.height * s];
  return { x: (r.width - width) / 2, y: (r.height - height) / 2, width, height };
}

function spot(clientX, clientY) {
  const r = canvas.getBoundingClientRect(), p = place();
  return { x: (clientX - r.left - p.x) / p.width, y: (clientY - r.top - p.y) / p.height };
}

const times = [];
function picture(header, image) {
  const { width, height } = header.camera;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.imageSmoothingQuality = "high";
  context.drawImage(image, 0, 0, width, height);
  Object.assign(state, { header, drawn: state.drawn + 1 });
  const now = performance.now();
  times.push(now);
  while (times[0] < now - 2000) times.shift();
  seen.rate = times.length > 1 ? ((times.length - 1) * 1000) / Math.max(now - times[0], 1) : 0;
  const { beside } = header;
  if (beside?.viewer === state.you && beside.at && beside.at !== state.answered) {
    state.answered = beside.at;
    const waited = now - beside.at;
    seen.latency = seen.latency == null ? waited : seen.latency + 0.3 * (waited - seen.latency);
  }
  $("curtain").className = "up";
  showLegend($("legend"), header.legend);
  $("glance").textContent = `${seen.rate.toFixed(1)} frames/s · ${drawn(header)}` + (seen.latency == null ? "" : ` · ${ms(seen.latency)}`);
  // Whoever is given the controls goes on from what everybody sees.
  if (!orbit.enabled) state.camera = orbit.follow(header.camera);
  showLens(header.camera);
  showKept();
  if (!header.moving) lookForLamps();
  gizmo.draw(header.camera, state.scene, state.selection);
}

function drawn({ moving, width, height, frames, known }) {
  if (moving) return `${width}×${height}`;
  if (frames === 0) return `${Math.floor(100 * known)} % of the first frame`;
  return `${frames} ${frames === 1 ? "frame" : "frames"}`;
}

// ---- the way to the master

const curtain = (text, thin) => { $("curtain").className = thin ? "thin" : ""; $("curtain-text").textContent = text; };
let bytesBefore = 0, bytesAt = performance.now();

const link = new Link({
  // What is on the screen may be of another master: it counts no more.
  up: () => { curtain("Waiting for the first picture…", state.drawn > 0); state.header = null; shape(); tellHidden(); },
  // Nobody has the controls of what is not there.
  down: () => { mayMove(false); curtain(state.drawn > 0 ? "The master is gone. Trying to reach it again…" : "Connecting…", state.drawn > 0); },
  picture,
  welcome({ you, scene, camera, knobs, methods, steps }) {
    // The master may have come back with another scene.
    const again = state.you === you && state.scene?.name === scene.name;
    if (state.scene && state.scene.name !== scene.name) orbit.home = orbit.up = undefined;
    Object.assign(state, { you, scene, methods, method: null });
    $("name").textContent = document.title = scene.name || "igi";
    // In a room people look around; before a thing they turn it.
    if (!orbit.home && isInside(camera.origin, scene)) document.querySelector('[data-drag="look"]').click();
    orbit.set(camera);
    state.camera = camera;
    showKnobs(knobs);
    showSteps(steps);
    showTime();
    select(again ? state.selection : null);
  },
  knobs: (words) => showKnobs(words),
  hues({ hues }) { state.hues = hues; refreshSelection(); },
  views({ views }) { state.views = views; showViews(); },
  presets({ presets }) {
    state.presets = presets;
    refill($("presets"), (node) => showPresets(node, presets, goPreset, (number) => link.say("forget_preset", { number })));
  },
  look({ camera }) { orbit.set(camera); state.camera = camera; },
  offer({ offer }) { state.offer = offer; showOffer(); },
  saved: ({ file, edits }) => toast(`Saved with ${edits} ${edits === 1 ? "edit" : "edits"}: ${file}`, true),
  notice: ({ text }) => toast(text),
  hung({ by, lights, text }) {
    if (by === state.you) choose(new Set(lights.map((light) => `light ${light}`)));
    toast(text, true);
  },
  edited({ changes, poses, pieces, solids, steps, by }) {
    showSteps(steps);
    for (const solid of state.scene ? solids : []) {
      state.scene.textures[solid.texture] = solid.name;
      state.scene.solids.push(solid);
    }
    // Pieces of objects are known only when somebody has done something to them.
    for (const piece of pieces ?? []) meet(piece);
    // This page's own edits are there already, and newer ones may be; where a time puts what moves, only the master knows.
    const own = by === state.you;
    if (!own) changes.forEach(learn);
    if (!own || changes.some((change) => "Time" in change)) {
      for (const [object, place] of poses ?? []) if (state.scene?.objects[object]) state.scene.objects[object].place = place;
    }
    if (by === state.you) return redraw();
    refreshSelection();
    redraw();
  },
  controls({ holder, viewers }) {
    const isNews = holder !== state.holder;
    Object.assign(state, { holder, viewers });
    mayMove(holder === state.you && state.scene != null);
    if (isNews || holder == null) hideControls();
    if (holder == null) offerControls();
    showOffer();
    redraw();
  },
  asked({ by }) {
    const give = el("button", { textContent: "Hand over" }), keep = el("button", { textContent: "Keep" });
    give.onclick = () => { link.say("give", { to: by }); hideControls(); };
    keep.onclick = () => { link.say("give", { to: state.you }); hideControls(); };
    showControls(`Viewer ${by} asks for the controls.`, [give, keep]);
  },
  picked({ x, y, found }) {
    state.picked = found;
    const { wanted } = state;
    if (wanted?.x === Math.fround(x) && wanted.y === Math.fround(y)) {
      state.wanted = null;
      if (wanted.select) select(found && meant(found, wanted.other));
      else orbit.pivot = found?.point ?? null;
    }
  },
  walked: ({ origin }) => orbit.walked(origin),
  probed(words) { if (!sawLamp(words)) { state.probed = words; showProbe(words); } },
  status(status) {
    const now = performance.now();
    seen.bytes = ((link.bytes - bytesBefore) * 1000) / Math.max(1, now - bytesAt);
    [bytesBefore, bytesAt] = [link.bytes, now];
    if (times.length && now - times.at(-1) > 1500) seen.rate = 0;
    state.status = status;
    showStats($("stats"), $("workers"), status, state.header, seen);
    $("mix-status").textContent = mixing(status.mix);
    if (!state.header) curtain(status.ready > 0 ? "Drawing…" : status.workers.length ? "Workers prepare the scene…" : "Waiting for workers…", state.drawn > 0);
  },
  // This page has shown already what it asked for: it learns again how things are.
  refused: ({ reason }) => { toast(reason); link.say("refresh"); },
  trouble: ({ reason }) => toast(`A part of the picture could not be drawn: ${reason}`),
});

/** How far lamps are drawn apart, in words. */
function mixing(mix) {
  if (!mix) return "";
  if (mix.lamps === 0) return "when the picture rests";
  return mix.drawn < mix.lamps ? `${mix.drawn} of ${mix.lamps} lamps` : `ready, ${mix.frames} ${mix.frames === 1 ? "frame" : "frames"}`;
}

/** What an earlier master has kept: whoever has the controls says what becomes of it. */
function showOffer() {
  const bar = $("offer-bar"), { offer } = state;
  bar.hidden = !offer || state.holder !== state.you;
  if (bar.hidden) return;
  const saved = new Date(offer.saved * 1000), today = saved.toDateString() === new Date().toDateString();
  const when = saved.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
  const day = today ? "" : `${saved.toLocaleDateString()}, `;
  const edits = `${offer.edits} ${offer.edits === 1 ? "edit" : "edits"} of ${state.scene?.name || "this scene"} from ${day}${when}`;
  const note = offer.files_changed ? " The scene's files have changed since: what still fits is taken up." : "";
  const take = el("button", { id: "take-up", textContent: "Take them up again" });
  const fresh = el("button", { id: "start-afresh", textContent: "Start afresh", title: "Forgets them" });
  take.onclick = () => link.say("take_up");
  fresh.onclick = () => link.say("start_afresh");
  bar.replaceChildren(el("span", { textContent: `${edits} ${offer.edits === 1 ? "is" : "are"} kept.${note}` }), take, fresh);
}

/** Keeps what is told of a piece, unless it is known. */
function meet(piece) {
  if (state.scene && !findPiece(state.scene, piece)) state.scene.pieces.push(piece);
}

/** What a click means: a piece of a room, or an object as a whole; with Shift the other. */
function meant({ object, piece, is_room, material }, other) {
  if (piece) meet(piece);
  return piece && is_room !== other ? { kind: "piece", object, piece: piece.piece, material } : { kind: "object", index: object, material };
}

function isInside(point, scene) {
  const corners = scene.objects.filter((o) => o.box && o.visible).flatMap((o) => [...Array(8).keys()].map((i) => apply(o.place, [0, 1, 2].map((a) => o.box[(i >> a) & 1][a]))));
  return [0, 1, 2].every((a) => corners.some((c) => c[a] < point[a]) && corners.some((c) => c[a] > point[a]));
}

function toast(text, isGood = false) {
  Object.assign($("toast"), { textContent: text, hidden: false, className: isGood ? "good" : "" });
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => { $("toast").hidden = true; }, 4000);
}

// ---- who has the controls

/** Whether this page may move the camera, edit and turn knobs. */
function mayMove(may) {
  orbit.enabled = may;
  document.body.dataset.holder = String(may);
  document.querySelectorAll("[data-controls]").forEach((node) => { node.inert = !may; });
  $("watching").hidden = may || state.you == null;
  if (!may) $("play").setAttribute("aria-pressed", "false");
}

function showControls(text, buttons, forMs) {
  $("controls-bar").replaceChildren(el("span", { textContent: text }), ...buttons);
  $("controls-bar").hidden = false;
  clearTimeout(showControls.timer);
  if (forMs) showControls.timer = setTimeout(hideControls, forMs);
}
function hideControls() {
  clearTimeout(showControls.timer);
  $("controls-bar").hidden = true;
}

/** Tells who watches how to get the controls: when somebody tries to take a hold, not before. */
function offerControls() {
  if (state.you == null || state.holder === state.you || !$("controls-bar").hidden) return;
  const { holder } = state;
  const take = el("button", { textContent: holder == null ? "Take the controls" : "Ask for the controls" });
  take.onclick = () => {
    link.say("take");
    if (holder != null) showControls(`Viewer ${holder} is asked.`, [], OFFERED_MS);
  };
  if (holder == null) showControls("Nobody has the controls.", [take]);
  else showControls(`You are watching: viewer ${holder} has the controls.`, [take], OFFERED_MS);
}
const OFFERED_MS = 8000;
$("watching").onclick = offerControls;
// What is inert lets the pointer through to the panel.
$("panel").addEventListener("pointerdown", (e) => { if (e.target === $("panel") || e.target.querySelector?.("[inert]")) offerControls(); });

/** Newest wins: at most one word of a kind each time the screen is drawn. */
const pending = new Map();
function soon(kind, send) {
  if (pending.size === 0) requestAnimationFrame(() => { const all = [...pending.values()]; pending.clear(); all.forEach((send) => send()); });
  pending.set(kind, send);
}

// ---- the camera

const orbit = new Orbit(canvas, {
  moved(camera) {
    state.camera = camera;
    const at = performance.now(), from = viewpoint(camera);
    soon("look", () => link.say("look", { ...from, at }));
  },
  clicked(x, y, { shiftKey, pointerType }) {
    const lamp = gizmo.lampAt(x, y, pointerType);
    if (lamp && shiftKey) choose(new Set([...state.lamps.chosen, `light ${lamp.index}`]));
    else if (lamp) select(lamp);
    else ask(x, y, true, shiftKey);
    // A finger does not hover.
    if ($("probe-on").checked) { state.pointer = { x, y }; metering = 0; meter(); }
  },
  pivotAt(x, y) { ask(x, y, false); },
  hovered(x, y) {
    const lamp = gizmo.lampAt(x, y, "mouse");
    canvas.classList.toggle("on-lamp", lamp != null);
    canvas.title = lamp ? lampName(state.scene, lamp.index) : "";
    if ($("probe-on").checked) { state.pointer = { x, y }; meter(); }
  },
  refused: offerControls,
  walk: (origin, by, height) => link.say("walk", { origin, by, height }),
});

/** What the master is told of a camera. */
const viewpoint = ({ origin, target, up, fov_y_deg, two_point = false, cut = false }) => ({ origin, target, up, fov_y_deg, two_point, cut });

function ask(clientX, clientY, select, other = false) {
  const at = spot(clientX, clientY);
  // Comes back as 32-bit numbers: compare as such.
  state.wanted = { x: Math.fround(at.x), y: Math.fround(at.y), select, other };
  link.say("pick", { x: Math.fround(at.x), y: Math.fround(at.y) });
}

// ---- how large the picture is: as large as the place for it, in pixels of the screen

const stage = $("stage");
/** Pixels that the place covers. `devicePixelContentBoxSize` would say the same, but not where a screen is emulated, nor in every browser. */
function measure() {
  const { left, right, top, bottom } = stage.getBoundingClientRect();
  const pixels = (from, to) => Math.round(to * devicePixelRatio) - Math.round(from * devicePixelRatio);
  return [pixels(left, right), pixels(top, bottom)];
}
function shape() {
  const [width, height] = measure();
  if (width > 0 && height > 0) link.say("shape", { width, height });
}
let shaping;
function reshaped() {
  clearTimeout(shaping);
  shaping = setTimeout(shape, SETTLED_MS);
  redraw();
}
/** A size that has stayed so long is meant. */
const SETTLED_MS = 150;
new ResizeObserver(reshaped).observe(stage);
/** On another screen, or zoomed, the place may be as large as before and have other pixels. */
function heedRatio() {
  matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener("change", () => { reshaped(); heedRatio(); }, { once: true });
}
heedRatio();

// Workers rest while nobody looks.
const tellHidden = () => link.say("hidden", { hidden: document.hidden });
document.addEventListener("visibilitychange", tellHidden);

// ---- editing

const gizmo = new Gizmo($("overlay"), { place, edit, dropped: () => refreshSelection(), enabled: () => state.holder === state.you });
const redraw = () => gizmo.draw(state.header?.camera, state.scene, state.selection);

function edit(changes, gesture = null) {
  changes.forEach(learn);
  const at = performance.now();
  const about = changes.flatMap((c) => Object.entries(c)).map(([kind, v]) => [kind, v.object, v.piece, v.material, v.light]).join();
  soon(`edit ${about}`, () => link.say("edit", { changes, gesture, at }));
  redraw();
}

/** Makes a change in this page's copy of the scene. */
function learn(change) {
  const [[kind, value]] = Object.entries(change);
  const { scene } = state;
  if (!scene) return;
  learnHue(state.hues, scene, change);
  if (kind === "Transform" && scene.objects[value.object]) scene.objects[value.object].place = value.scene_from_object;
  if (kind === "Visible" && scene.objects[value.object]) scene.objects[value.object].visible = value.visible;
  const piece = kind.startsWith("Piece") && findPiece(scene, value);
  if (piece && kind === "PieceTransform") piece.place = value.whole_from_piece;
  if (piece && kind === "PieceVisible") piece.visible = value.visible;
  if (kind === "Material") scene.materials[value.material] = value.value;
  if (kind === "OwnMaterial") learnMaterial(scene, value);
  if (kind === "Light") scene.lights[value.light] = value.value;
  if (kind === "Lamp") {
    while (scene.lights.length <= value.light) scene.lights.push(ABSENT);
    scene.lights[value.light] = value.value?.light ?? ABSENT;
    scene.light_names[value.light] = value.value?.name ?? "";
    // As the master has it: what stands for lamps that are gone only keeps the numbers of those behind.
    while (scene.lights.length && isAbsent(scene.lights.at(-1))) scene.lights.pop();
    scene.light_names.length = Math.min(scene.light_names.length, scene.lights.length);
  }
  if (kind === "Environment") scene.environment = value;
  if (kind === "Time") { $("time").value = value; $("time-out").textContent = value.toFixed(2); }
}

let gestures = Date.now() * 1000;
const act = {
  edit, gesture: () => ++gestures, again: (selection) => select(selection), up: () => orbit.up,
  /** What it gave that is off: by number, of `lights` or `materials`. */
  changed: () => refreshSelection(), choose, solo: (all, keys) => toggleSolo(all, keys, state.lamps.solo, act), pivot: (selection) => gizmo.pivot(state.scene, selection), shift: (selection, by) => gizmo.shift(selection, by),
  hue: (kind, number) => ({ value: state.hues[kind][number] ?? [1, 1, 1], keep(colour) { state.hues[kind][number] = this.value = colour; } }),
  ownHue: (change) => act.hue(state.hues.own[ownKey(change)] ? "own" : "materials", state.hues.own[ownKey(change)] ? ownKey(change) : change.material),
};

function select(selection) {
  state.selection = selection;
  state.lamps.chosen = new Set(selection?.kind === "light" ? [`light ${selection.index}`] : []);
  refreshSelection();
  redraw();
}
/** Chooses lamps by their keys; one light by itself is selected as well. */
function choose(chosen) {
  const [only] = chosen.size === 1 ? chosen : [];
  const light = /^light (\d+)$/.exec(only ?? "");
  state.selection = light ? { kind: "light", index: +light[1] } : null;
  state.lamps.chosen = chosen;
  refreshSelection();
  redraw();
}
function refreshSelection() {
  if (!state.scene) return;
  // What was taken away is selected no more.
  const isThere = (key) => !key.startsWith("light ") || !isAbsent(state.scene.lights[+key.slice(6)]);
  if (state.selection?.kind === "light" && !isThere(`light ${state.selection.index}`)) state.selection = null;
  state.lamps.chosen = new Set([...state.lamps.chosen].filter(isThere));
  const lights = chosenLights().length > 0;
  $("duplicate-lamps").disabled = $("delete-lamps").disabled = !lights;
  refill($("selection"), (node) => showSelection(node, state.scene, state.selection, act));
  refill($("things"), (node) => showThings(node, state.scene, state.selection, select));
  const { scene, hues, lamps } = state;
  gizmo.chosen = lamps.chosen;
  refill($("lamps"), (node) => showLamps(node, scene, hues, lamps, act));
  refill($("chosen-lamps"), (node) => showChosen(node, scene, hues, lamps, act));
}
/** Numbers of the lights that are chosen. */
function chosenLights() {
  return [...state.lamps.chosen].filter((key) => key.startsWith("light ")).map((key) => +key.slice(6));
}
$("add-lamp").onclick = () => {
  if (!orbit.camera) return;
  const { origin, target } = orbit.camera;
  const change = added(state.scene, origin.map((v, axis) => v + 0.6 * (target[axis] - v)));
  edit([change]);
  choose(new Set([`light ${change.Lamp.light}`]));
};
$("duplicate-lamps").onclick = () => {
  const { right } = lens(orbit.camera), by = right.map((v) => 0.1 * length(sub(orbit.camera.target, orbit.camera.origin)) * v);
  const gesture = ++gestures, keys = new Set();
  for (const index of chosenLights()) {
    const change = duplicated(state.scene, index, by);
    edit([change], gesture);
    keys.add(`light ${change.Lamp.light}`);
  }
  choose(keys);
};
$("delete-lamps").onclick = () => {
  const changes = chosenLights().map(removed);
  if (changes.length) edit(changes);
  choose(new Set());
};
takeFiles(stage, $("hang-file"), $("luminaire-file"), {
  may: () => orbit.enabled, refused: offerControls, toast, say: (word, rest) => soon(word, () => link.say(word, rest)), spot, chosen: chosenLights,
  lampAt: (x, y, pointer) => gizmo.lampAt(x, y, pointer), name: (index) => lampName(state.scene, index),
  hint: (text) => Object.assign($("drop-hint"), { hidden: text == null, textContent: text ?? "" }),
});
// ---- how lamps are, under names

/** Seconds from one preset to the other. */
const fadeTime = entry("Fade", 2, { units: { s: 1 }, shown: "s", min: 0, max: 600, title: "Time from one preset to the other" }, (seconds) => { state.fade = seconds; });
$("fade-time").replaceWith(fadeTime);
state.fade = 2;
let stopFade = () => {};
function goPreset(number) {
  if (!orbit.enabled) return offerControls();
  stopFade();
  Object.assign(state.lamps.solo, { keys: [], others: [] });
  stopFade = fade(state.scene, state.presets[number], 1000 * state.fade, act);
}
$("save-preset").onclick = () => {
  const field = $("preset-name"), name = field.value.trim() || `Preset ${state.presets.length + 1}`;
  soon("preset", () => link.say("save_preset", { name }));
  field.value = "";
};
$("lamp-by").replaceChildren(...Object.entries(GROUPINGS).map(([value, [label]]) => el("option", { value, textContent: label })));
$("lamp-by").onchange = () => { state.lamps.by = $("lamp-by").value; refreshSelection(); };
$("lamp-words").oninput = () => { state.lamps.words = $("lamp-words").value; refreshSelection(); };

// ---- markers of lamps: not of those that are behind something

$("markers").onchange = () => { gizmo.markers = $("markers").checked; redraw(); };
/** A lamp stands in its shade, and is still seen to be there: as far behind a surface, as a share of its distance. */
const WITHIN_SHADE = 0.08;
const sight = { picture: null, lamps: [], asked: null };
/** Asks about each lamp in turn how far it is to what is seen in its place, once for each still picture. */
function lookForLamps() {
  const { world, camera } = state.header, about = JSON.stringify([world, camera]);
  if (!gizmo.markers || !state.scene || sight.picture === about) return;
  Object.assign(sight, { picture: about, lamps: state.scene.lights.map((_, i) => i).slice(0, 200) });
  lookOn();
}
function lookOn() {
  const { camera } = state.header, seen = lens(camera);
  sight.asked = null;
  while (sight.lamps.length && !sight.asked) {
    const index = sight.lamps.shift(), place = position(state.scene.lights[index] ?? {}), at = place && seen.project(place);
    if (!at || at.x < 0 || at.x >= 1 || at.y < 0 || at.y >= 1) gizmo.hidden.delete(index);
    else sight.asked = { index, x: Math.fround(at.x), y: Math.fround(at.y), far: length(sub(place, camera.origin)) };
  }
  if (sight.asked) link.say("probe", { x: sight.asked.x, y: sight.asked.y });
  else redraw();
}
/** Whether an answer of the light meter was about a lamp. */
function sawLamp({ x, y, found }) {
  const { asked } = sight;
  if (asked?.x !== Math.fround(x) || asked.y !== Math.fround(y)) return false;
  const behind = found?.distance != null && found.distance < asked.far * (1 - WITHIN_SHADE);
  gizmo.hidden[behind ? "add" : "delete"](asked.index);
  lookOn();
  return true;
}

// ---- the picture beside one that was kept

/** Keeps the picture as it is; kept already, forgets it. */
$("keep-picture").onclick = () => {
  const kept = $("kept"), keeps = kept.hidden;
  if (keeps) {
    Object.assign(kept, { width: canvas.width, height: canvas.height });
    kept.getContext("2d").drawImage(canvas, 0, 0);
  }
  kept.hidden = !keeps;
  $("compare").disabled = !keeps;
  $("keep-picture").textContent = keeps ? "Forget" : "Keep";
  showKept();
};
$("compare").oninput = () => showKept();
/** The kept picture is seen left of where the slider stands. */
function showKept() {
  if ($("kept").hidden) return;
  const p = place(), all = canvas.getBoundingClientRect().width;
  const edge = p.x + (p.width * +$("compare").value) / 100;
  $("kept").style.clipPath = `inset(0 ${all - edge}px 0 0)`;
}
/** Fills a node anew; what had the focus in it has it again, so that keys go on where they were. */
function refill(node, fill) {
  const nth = [...node.querySelectorAll("button, input, select")].indexOf(document.activeElement);
  fill(node);
  if (nth >= 0) node.querySelectorAll("button, input, select")[nth]?.focus({ preventScroll: true });
}
// Each grip of a slider is a step of its own to be undone.
$("selection").addEventListener("change", () => refreshSelection());

function showSteps([done, undone]) { $("undo").disabled = !done; $("redo").disabled = !undone; }
$("undo").onclick = () => link.say("undo");
$("redo").onclick = () => link.say("redo");
// What was edited a moment ago waits for the screen to be drawn: saving does, too, and comes after it.
const save = () => (orbit.enabled ? soon("save", () => link.say("save")) : offerControls());
$("save").onclick = $("save-scene").onclick = save;

// ---- the panel

function showKnobs({ tone, layer, rate, method, denoise, mix }) {
  const put = (id, value) => { if (document.activeElement !== $(id)) $(id).value = value; };
  for (const id of ["exposure", "exposure-number"]) put(id, +tone.exposure.toFixed(2));
  if (document.activeElement !== ev) ev.show(ev100(tone.exposure));
  put("tone", tone.operator);
  put("rate", rate);
  $("rate-out").textContent = rate;
  showMethod(method);
  put("layer", layer);
  // Only where there is a denoiser.
  $("denoise-row").hidden = denoise === null;
  $("denoise").checked = denoise === true;
  $("mix").checked = mix;
  state.tone = tone;
}
/** What can be set and looked at, as the method describes it. */
function showMethod({ name, settings }) {
  const method = state.methods?.find((known) => known.name === name);
  if (!method) return;
  const option = (value, label, about = "", selected = false) => el("option", { value, textContent: label, title: about, selected });
  if (state.method !== name) {
    state.method = name;
    $("method").replaceChildren(...state.methods.map((known) => option(known.name, known.name, known.about, known.name === name)));
    $("method").closest("label").hidden = state.methods.length < 2;
    $("method").title = method.about;
    $("layer").replaceChildren(...method.layers.map((layer) => option(layer.name, layer.label)));
    const turn = (knob, value) => soon(`knob ${knob}`, () => link.say("turn", { values: { [knob]: value } }));
    $("method-knobs").replaceChildren(...methodControls(method, turn));
  }
  for (const { name: knob } of method.knobs) $(`knob-${knob}`).show(settings[knob]);
}
/** The master tells how it is shown from then on. */
function tone(change) {
  if (!state.tone) return;
  // What the master tells of an earlier choice may come before this is sent.
  const chosen = Object.assign(state.tone, change);
  soon("tone", () => link.say("tone", chosen));
}
$("exposure").oninput = () => { const stops = +$("exposure").value; $("exposure-number").value = stops; tone({ exposure: stops }); };
// A number that is half typed is none yet.
$("exposure-number").oninput = () => {
  const box = $("exposure-number"), stops = parse(box.value, { EV: 1 });
  const isOne = stops != null && Math.abs(stops) <= STOPS_MAX;
  box.ariaInvalid = String(!isOne);
  if (!isOne) return;
  $("exposure").value = stops;
  tone({ exposure: stops });
};
/** As far as the master exposes. */
const STOPS_MAX = 60;
// The same formula leads there and back.
const ev = entry("EV100", 0, { units: { EV: 1 }, min: ev100(STOPS_MAX), max: ev100(-STOPS_MAX), read: (v) => String(+v.toFixed(2)), title: "Exposure value at ISO 100; type any number" }, (value) => tone({ exposure: ev100(value) }));
$("ev100").replaceWith(ev);
$("tone").onchange = () => tone({ operator: $("tone").value });
$("auto-expose").onclick = () => link.say("auto_expose");
$("denoise").onchange = () => link.say("denoise", { on: $("denoise").checked });
$("mix").onchange = () => link.say("mix", { on: $("mix").checked });
$("layer").onchange = () => link.say("inspect", { layer: $("layer").value });
$("rate").oninput = () => { $("rate-out").textContent = $("rate").value; soon("rate", () => link.say("rate", { rate: +$("rate").value })); };
$("method").onchange = () => link.say("method", { name: $("method").value });

document.querySelectorAll("[data-drag]").forEach((button) => {
  button.onclick = () => {
    orbit.mode = button.dataset.drag;
    document.querySelectorAll("[data-drag]").forEach((b) => b.setAttribute("aria-checked", String(b === button)));
  };
});
$("frame").onclick = () => frame();
function frame() {
  const around = state.selection && orbit.camera && ball(state.scene, state.selection, 0.3 * length(sub(orbit.camera.target, orbit.camera.origin)));
  if (around) orbit.frame(...around);
}
$("full").onclick = full;
function full() { document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen?.(); }
$("toggle-panel").onclick = () => {
  const bare = document.body.classList.toggle("bare");
  $("toggle-panel").setAttribute("aria-expanded", String(!bare));
};
// What is saved is what is shown, with the light meter's mark and reading.
for (const id of ["png", "exr"]) $(id).onclick = () => {
  const words = new URLSearchParams(location.search);
  const at = !$("probe").hidden && state.pointer && spot(state.pointer.x, state.pointer.y);
  if (at) { words.set("meter_x", at.x); words.set("meter_y", at.y); }
  $(id).href = `/picture.${id}?${words}`;
};

// ---- the light meter

let metering = 0;
function meter() {
  const now = performance.now();
  if (now - metering < 120 || !state.pointer) return;
  metering = now;
  link.say("probe", spot(state.pointer.x, state.pointer.y));
}
setInterval(() => { if ($("probe-on").checked) meter(); }, 500);
$("probe-on").onchange = () => { $("probe").hidden = true; };
function showProbe({ found }) {
  const node = $("probe");
  node.hidden = !found || !$("probe-on").checked || !state.pointer;
  if (node.hidden) return;
  const stage = $("stage").getBoundingClientRect();
  Object.assign(node.style, { left: `${Math.min(state.pointer.x - stage.left, stage.width - 250)}px`, top: `${Math.min(state.pointer.y - stage.top, stage.height - 110)}px` });
  node.replaceChildren(
    el("b", { textContent: `${short(found.lux)} lx` }),
    el("div", { textContent: `${short(found.candela_per_m2)} cd/m² · ${short(found.distance)} away` }),
    el("div", { className: "unit", textContent: state.scene.unit }),
  );
}

// ---- time

function showTime() {
  const span = state.scene.time;
  $("time-section").hidden = !span;
  if (span) Object.assign($("time"), { min: span[0], max: span[1] });
}
// A step of its own to be undone, apart from what sliders of the selection do.
let scrub = null;
$("time").oninput = () => edit([{ Time: +$("time").value }], scrub ??= ++gestures);
$("time").onchange = () => { scrub = null; };
$("play").onclick = () => {
  const playing = $("play").getAttribute("aria-pressed") !== "true";
  $("play").setAttribute("aria-pressed", String(playing));
  const [from, to] = state.scene.time;
  const gesture = ++gestures;
  let last = performance.now(), t = +$("time").value;
  const step = (now) => {
    if ($("play").getAttribute("aria-pressed") !== "true") return;
    t += (now - last) / 1000;
    last = now;
    if (t > to) t = from;
    edit([{ Time: t }], gesture);
    requestAnimationFrame(step);
  };
  if (playing) requestAnimationFrame(step);
};

// ---- saved views: the master keeps them, for everybody

function showViews() {
  refill($("views"), (node) => node.replaceChildren(...state.views.map(({ name, picture, lamps }, i) => {
    const key = i < 9 ? ` (key ${i + 1})` : "", lit = lamps?.length > 0;
    const button = el("button", { title: `${name || `View ${i + 1}`}${key}${lit ? ", with its lamps" : ""}; Shift click forgets it` });
    if (picture) button.append(el("img", { src: picture, alt: "" }));
    button.append(el("small", { textContent: `${i + 1}${lit ? " ☀" : ""}` }));
    button.onclick = (e) => { if (e.shiftKey) link.say("forget_view", { number: i }); else go(i); };
    const field = el("input", { type: "text", value: name ?? "", maxLength: 80, placeholder: `View ${i + 1}`, ariaLabel: `Name of view ${i + 1}` });
    field.onchange = () => link.say("name_view", { number: i, name: field.value.trim() });
    return el("div", { className: "view" }, button, field);
  })));
}
function go(i) {
  const view = state.views[i];
  if (!view) return;
  if (!orbit.enabled) return offerControls();
  look(viewpoint(view));
  if (view.lamps?.length) soon("relight", () => link.say("relight", { number: i }));
}
/** What is on the screen, small. */
function thumbnail() {
  const width = 96, height = Math.max(1, Math.round((width * canvas.height) / canvas.width)), small = new OffscreenCanvas(width, Math.min(height, 192));
  small.getContext("2d").drawImage(canvas, 0, 0, small.width, small.height);
  return small.convertToBlob({ type: "image/jpeg", quality: 0.7 }).then((blob) => new Promise((done) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result);
    reader.readAsDataURL(blob);
  }));
}

// ---- the lens

/** Of a film 24 mm high. */
const ofFocal = (mm) => (360 / Math.PI) * Math.atan(12 / mm);
const fov = entry("Field of view", 45, { units: { "°": 1, mm: ofFocal }, shown: "°", min: 1, max: 170, title: "Height of what is seen, in degrees; or a focal length in mm, of a film 36 mm by 24 mm" }, (deg) => turnLens(deg));
$("fov-number").replaceWith(fov);
$("fov").oninput = () => { fov.show(+$("fov").value); turnLens(+$("fov").value); };
function turnLens(fov_y_deg) {
  $("fov").value = fov_y_deg;
  if (!orbit.enabled || !orbit.camera) return offerControls();
  orbit.set({ ...orbit.camera, fov_y_deg });
  orbit.moved(orbit.camera);
}
/** Looks from there. */
function look(view) {
  orbit.set({ ...orbit.camera, ...view });
  orbit.moved(orbit.camera);
}
$("projection").onchange = () => {
  const { scene } = state, { camera } = orbit;
  if (!orbit.enabled || !camera || !scene) return offerControls();
  // Back from a plan, people stand where they stood.
  if (!camera.cut) orbit.stood = camera;
  const shape = canvas.width / canvas.height;
  look(viewpoint(seenAs($("projection").value, orbit.stood ?? perspective(scene, camera), scene, shape)));
};
const cut = entry("Cut", 0, { units: { m: 1, cm: 0.01, mm: 0.001, ft: 0.3048 }, shown: "m", min: -Infinity, max: Infinity, title: "In the scene's unit, or with one" }, (at) => cutThere(at));
$("cut-number").replaceWith(cut);
$("cut").oninput = () => { cut.show(+$("cut").value); cutThere(+$("cut").value); };
function cutThere(at) {
  if (!orbit.enabled || !orbit.camera?.cut) return offerControls();
  look(viewpoint(cutAt(orbit.camera, at)));
}
// ---- on foot

const eyes = entry("Eyes", 1.6, { units: { m: 1, cm: 0.01, mm: 0.001, ft: 0.3048 }, shown: "m", min: 0.05, max: 100, title: "Height of the eyes above what is stood on, in the scene's unit, or with one" }, (height) => { standing = height; stand(); });
$("eyes").replaceWith(eyes);
let standing = 1.6;
/** Puts people on their feet, or has them fly. */
function stand() {
  orbit.eyes = $("walk").checked ? standing : 0;
  orbit.walking = false;
  if (orbit.eyes > 0 && orbit.enabled && orbit.camera) orbit.step([0, 0, 0]);
}
$("walk").onchange = stand;
function showProjection(camera) {
  const kind = projectionOf(camera);
  if (document.activeElement !== $("projection")) $("projection").value = kind;
  $("cut-row").hidden = !camera.cut;
  $("lens-row").hidden = camera.cut;
  if (!camera.cut || [cut, $("cut")].includes(document.activeElement)) return;
  const [min, max] = reach(state.scene, camera);
  Object.assign($("cut"), { min, max, value: cutOf(camera) });
  cut.show(cutOf(camera));
}
function showLens(camera) {
  if (state.scene) showProjection(camera);
  const { fov_y_deg } = camera;
  if ([fov, $("fov")].includes(document.activeElement)) return;
  fov.show(fov_y_deg);
  $("fov").value = fov_y_deg;
}
$("save-view").onclick = async () => {
  if (!orbit.camera) return;
  const from = viewpoint(orbit.camera), name = $("view-name").value.trim(), lamps = $("view-lamps").checked;
  const picture = await thumbnail();
  link.say("save_view", { ...from, name, lamps, picture: picture.length <= THUMBNAIL_MAX ? picture : null });
  $("view-name").value = "";
};
/** The master keeps no larger one. */
const THUMBNAIL_MAX = 8192;

// ---- keys

const KEYS = [
  ["W A S D", "walk"], ["Q E", "sink, rise"], ["arrows", "look around"], ["F", "frame the selection"], ["R", "back to the first view"],
  ["click", "select a thing"], ["Space", "select what is in the middle"], ["Shift with either", "the whole object, or a piece of it"], ["1 … 9", "saved views"], ["[ ]", "exposure"],
  ["Alt arrows", "move the selection"], ["Alt Page ↑ ↓", "push, pull it"], ["Alt , .", "turn it"], ["Alt - +", "size it"], ["Esc", "select nothing"], ["Delete", "take away the lamps that are chosen"], ["Ctrl Z", "undo"], ["Ctrl Shift Z", "redo"], ["Ctrl S", "save the scene"],
  ["Enter", "full screen"], ["P", "panel"], ["right drag", "pan"], ["wheel, pinch", "nearer, farther"], ["?", "these keys"],
];
$("keys").replaceChildren(...KEYS.flatMap(([key, what]) => [el("kbd", { textContent: key }), el("span", { textContent: what })]));
$("help-open").onclick = () => $("help").showModal();
$("help-close").onclick = () => $("help").close();

/** Selects what is in the middle of the picture: for hands without a pointer. */
function middle(other) {
  const r = canvas.getBoundingClientRect();
  ask(r.x + r.width / 2, r.y + r.height / 2, true, other);
}

const NUDGES = {
  ArrowLeft: ["right", -1], ArrowRight: ["right", 1], ArrowDown: ["up", -1], ArrowUp: ["up", 1], PageDown: ["away", -1], PageUp: ["away", 1],
  ",": ["turn", 1], ".": ["turn", -1], "-": ["size", -1], "+": ["size", 1], "=": ["size", 1],
};
let byPointer = false;
addEventListener("pointerdown", () => { byPointer = true; }, true);
// Whoever has chosen from a list by the pointer goes on in the picture: letters walk again.
addEventListener("change", (e) => { if (byPointer && e.target.matches("select")) canvas.focus({ preventScroll: true }); });
addEventListener("keydown", (e) => {
  byPointer = false;
  // Also while a number is typed: the browser's own saves the page.
  if ((e.ctrlKey || e.metaKey) && !e.shiftKey && !e.altKey && e.key.toLowerCase() === "s") {
    if (state.scene) save();
    e.preventDefault();
    return;
  }
  // What was typed is meant: the picture has the keys again.
  if (e.key === "Enter" && e.target.matches(".quantity")) {
    canvas.focus({ preventScroll: true });
    e.preventDefault();
    return;
  }
  const typing = e.target.matches("input:not([type=range]):not([type=checkbox]), select, textarea");
  if (typing || $("help").open) return;
  if (e.key === "?") { $("help").showModal(); return; }
  // Nothing has been told of the scene yet.
  if (!state.scene) return;
  if ((e.ctrlKey || e.metaKey) && e.key.toLowerCase() === "z") {
    if (orbit.enabled) link.say(e.shiftKey ? "redo" : "undo");
    else offerControls();
    e.preventDefault();
    return;
  }
  const nudge = e.altKey && !e.ctrlKey && !e.metaKey && NUDGES[e.key];
  if (nudge) {
    if (orbit.enabled) gizmo.nudge(...nudge, e.repeat);
    else offerControls();
    e.preventDefault();
    return;
  }
  if (e.ctrlKey || e.metaKey || e.altKey) return;
  const onSlider = e.target.matches("input, button, a, summary");
  if (onSlider && /^(Arrow|Enter| )/.test(e.key)) return;
  if (orbit.key(e, true)) { e.preventDefault(); return; }
  const exposure = (by) => (orbit.enabled ? tone({ exposure: state.tone.exposure + by }) : offerControls());
  const actions = {
    f: frame, Escape: () => select(null), "[": () => exposure(-0.25), "]": () => exposure(0.25), Enter: full, p: () => $("toggle-panel").click(),
    Delete: () => (orbit.enabled ? $("delete-lamps").click() : offerControls()),
    " ": () => middle(e.shiftKey), r: () => (orbit.enabled ? look(viewpoint({ ...orbit.home, fov_y_deg: orbit.camera.cut ? orbit.home.fov_y_deg : orbit.camera.fov_y_deg })) : offerControls()),
  };
  if (/^[1-9]$/.test(e.key)) go(+e.key - 1);
  else (actions[e.key] ?? actions[e.key.toLowerCase()])?.();
});
addEventListener("keyup", (e) => orbit.key(e, false));
