// What lamps and glowing materials that are off gave before: they are to come back as they were.

import { isAbsent, power, skyPower } from "./light.js";
import { madeOf, ownKey } from "./pieces.js";

/** Keeps what a change turns off, in `hues`: `{ lights, materials }` by number, `own` by `ownKey`. */
export function learnHue(hues, scene, change) {
  const [[kind, value]] = Object.entries(change);
  if (kind === "Light" && scene.lights[value.light]) note(hues.lights, value.light, power(scene.lights[value.light]), power(value.value));
  if (kind === "Lamp") {
    const was = scene.lights[value.light];
    if (value.value && !isAbsent(was)) note(hues.lights, value.light, power(was), power(value.value.light));
    if (!value.value) delete hues.lights[value.light];
  }
  if (kind === "Environment") note(hues, "sky", skyPower(scene.environment) ?? [0, 0, 0], skyPower(value) ?? [0, 0, 0]);
  if (kind === "Material" && scene.materials[value.material]) {
    note(hues.materials, value.material, scene.materials[value.material].emission.value, value.value.emission.value);
  }
  if (kind === "OwnMaterial") {
    const was = madeOf(scene, value.object, value.piece, value.material);
    if (was && value.value) note(hues.own, ownKey(value), was.emission.value, value.value.emission.value);
    if (!value.value) delete hues.own[ownKey(value)];
  }
}

function note(hues, number, was, is) {
  if (Math.max(...is) > 0) delete hues[number];
  else if (Math.max(...was) > 0) hues[number] = was;
}
