// The colours of lamps and glowing materials that are off: black has none, and they are to come back as they were.

/** What a lamp gives, whatever the unit. */
export function power(light) {
  const [value] = Object.values(light);
  return value.irradiance ?? value.intensity;
}

/** Keeps what a change turns off, in `hues`: `{ lights, materials }` by number. */
export function learnHue(hues, scene, change) {
  const [[kind, value]] = Object.entries(change);
  if (kind === "Light" && scene.lights[value.light]) note(hues.lights, value.light, power(scene.lights[value.light]), power(value.value));
  if (kind === "Material" && scene.materials[value.material]) {
    note(hues.materials, value.material, scene.materials[value.material].emission.value, value.value.emission.value);
  }
}

function note(hues, number, was, is) {
  if (Math.max(...is) > 0) delete hues[number];
  else if (Math.max(...was) > 0) hues[number] = was.map((v) => v / Math.max(...was));
}
