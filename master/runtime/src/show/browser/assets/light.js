// What light is in figures that lighting designers use: candela, lumens, lux, kelvin. As `scenes/src/photometry.rs`.

const LUMENS_PER_WATT = 683;

/** Relative luminance of a linear colour. */
export const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;

/** A colour whose largest channel is 1; white for black. */
export function hueOf(rgb) {
  const most = Math.max(...rgb);
  return most > 0 ? rgb.map((v) => v / most) : [1, 1, 1];
}

/** How a light of such a colour is measured, as fields need it: the size of each unit in W·sr⁻¹ (W·m⁻² of suns, W·m⁻²·sr⁻¹
 *  of surfaces) of the largest channel, and the unit that is shown. `solids`: those of luminaires. */
export function measures(light, hue, solids = []) {
  const watt = LUMENS_PER_WATT * luminance(hue);
  const [kind] = light ? Object.keys(light) : ["Surface"];
  if (kind === "Directional") return { units: { lx: 1 / watt }, shown: "lx" };
  if (kind === "Surface") return { units: { "cd/m²": 1 / watt }, shown: "cd/m²" };
  if (kind === "Luminaire") {
    const steradians = solids.find(({ texture }) => texture === light.Luminaire.solid)?.steradians;
    return steradians > 0 ? { units: { lm: 1 / (watt * steradians), cd: 1 / watt, W: LUMENS_PER_WATT / (watt * steradians) }, shown: "lm" } : { units: { cd: 1 / watt }, shown: "cd" };
  }
  // Between its cones a spot falls off as the square of a ramp in the cosine.
  const { cos_inner: inner, cos_outer: outer } = light[kind];
  const directions = kind === "Spot" ? 2 * Math.PI * (1 - inner + (inner - outer) / 3) : 4 * Math.PI;
  return { units: { lm: 1 / (watt * directions), cd: 1 / watt, W: LUMENS_PER_WATT / (watt * directions) }, shown: "lm" };
}

/** What a lamp gives, whatever the unit. */
export function power(light) {
  const [value] = Object.values(light);
  return value.irradiance ?? value.intensity;
}

/** The light with another power. */
export function withPower(light, rgb) {
  const [[kind, value]] = Object.entries(light);
  return { [kind]: { ...value, [kind === "Directional" ? "irradiance" : "intensity"]: rgb } };
}

/** What the master has where a light was taken away, so that those behind it keep their numbers. */
export const ABSENT = { Directional: { direction: [0, -1, 0], irradiance: [0, 0, 0], diameter_deg: 180 } };
export const isAbsent = (light) => !light || (light.Directional?.diameter_deg === 180 && Math.max(...light.Directional.irradiance) === 0);

/** What a sky gives, or the factor of its image; nothing of a black one. */
export const skyPower = (sky) => sky?.Constant ?? sky?.Image?.scale ?? null;
/** Degrees that an image of the sky is turned, from −z towards +x. */
export const skyTurn = (sky) => 360 * (sky?.Image?.turn ?? 0);

/** The changes that turn a sky so, and the suns along with it about the upright (+y). */
export function turnedSky({ environment, lights }, deg) {
  const by = ((deg - skyTurn(environment)) * Math.PI) / 180, [sin, cos] = [Math.sin(by), Math.cos(by)];
  const turn = ({ direction: [x, y, z], ...sun }) => ({ Directional: { ...sun, direction: [x * cos - z * sin, y, z * cos + x * sin] } });
  const suns = lights.flatMap((light, index) => (light.Directional && !isAbsent(light) ? [{ Light: { light: index, value: turn(light.Directional) } }] : []));
  return [{ Environment: { Image: { ...environment.Image, turn: deg / 360 } } }, ...suns];
}

export const withSky = (sky, rgb) => (sky.Image ? { Image: { ...sky.Image, scale: rgb } } : { Constant: rgb });

export const KELVIN = [1667, 25000];

/** CIE 1931 xy of a black body (Kim et al. 2002). */
function planck(kelvin) {
  const t = 1e3 / kelvin;
  const cubic = ([a, b, c, d], x) => ((a * x + b) * x + c) * x + d;
  const x = kelvin <= 4000 ? cubic([-0.2661239, -0.2343589, 0.8776956, 0.17991], t) : cubic([-3.0258469, 2.1070379, 0.2226347, 0.24039], t);
  if (kelvin <= 2222) return [x, cubic([-1.1063814, -1.3481102, 2.18555832, -0.20219683], x)];
  if (kelvin <= 4000) return [x, cubic([-0.9549476, -1.37418593, 2.09137015, -0.16748867], x)];
  return [x, cubic([3.081758, -5.8733867, 3.75112997, -0.37001483], x)];
}

/** The linear Rec. 709 colour of a black body, its largest channel 1. */
export function ofKelvin(kelvin) {
  const [x, y] = planck(Math.min(KELVIN[1], Math.max(KELVIN[0], kelvin)));
  const [X, Z] = [x / y, (1 - x - y) / y];
  const rgb = [3.2406 * X - 1.5372 - 0.4986 * Z, -0.9689 * X + 1.8758 + 0.0415 * Z, 0.0557 * X - 0.204 + 1.057 * Z];
  return hueOf(rgb.map((v) => Math.max(0, v)));
}

/** CIE 1960 uv of a linear Rec. 709 colour. */
function uv([r, g, b]) {
  const X = 0.4124 * r + 0.3576 * g + 0.1805 * b, Y = luminance([r, g, b]), Z = 0.0193 * r + 0.1192 * g + 0.9505 * b;
  const sum = X + 15 * Y + 3 * Z;
  return [(4 * X) / sum, (6 * Y) / sum];
}

/** The temperature of the black body whose colour is nearest (correlated colour temperature); null of colours that are none
 *  of a lamp, 0.05 from any in uv (CIE 15). */
export function kelvinOf(rgb) {
  if (!(Math.max(...rgb) > 0)) return null;
  const [u, v] = uv(rgb);
  const away = (mired) => { const [a, b] = uv(ofKelvin(1e6 / mired)); return Math.hypot(a - u, b - v); };
  // Mireds are even to the eye: the nearest of a few, and then between its neighbours.
  const all = [...Array(57).keys()].map((i) => 40 + 10 * i);
  const nearest = all.reduce((best, mired) => (away(mired) < away(best) ? mired : best));
  let [low, high] = [Math.max(40, nearest - 10), Math.min(599.8, nearest + 10)];
  for (let i = 0; i < 40; i++) {
    const [a, b] = [low + (high - low) / 3, high - (high - low) / 3];
    if (away(a) < away(b)) high = b; else low = a;
  }
  const mired = (low + high) / 2;
  return away(mired) < 0.05 ? 1e6 / mired : null;
}

/** EV at ISO 100 of a camera that shows as white what a picture exposed by so many stops does: its sensor is full at
 *  1.2 · 2^EV cd/m² (ISO 12232, saturation). The same formula leads back. */
export const ev100 = (stops) => Math.log2(LUMENS_PER_WATT / 1.2) - stops;
