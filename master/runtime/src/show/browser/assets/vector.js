// Arrays of three numbers, 3×3 matrices by columns (as the master's), and the camera's lens.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => { const l = length(a); return l > 0 ? scale(a, 1 / l) : a; };
export const middle = (a, b) => scale(add(a, b), 0.5);

/** Rotates v by an angle about a unit axis (Rodrigues). */
export function turn(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return add(add(scale(v, c), scale(cross(axis, v), s)), scale(axis, dot(axis, v) * (1 - c)));
}

/** A transform's effect on a point; its matrix is nine numbers, column by column. */
export function apply({ linear: m, translation: t }, p) {
  return [0, 1, 2].map((i) => m[i] * p[0] + m[3 + i] * p[1] + m[6 + i] * p[2] + t[i]);
}

/** What first does the other, then this. */
export function after(outer, inner) {
  const columns = [0, 3, 6].flatMap((c) => sub(apply(outer, inner.linear.slice(c, c + 3)), outer.translation));
  return { linear: columns, translation: apply(outer, inner.translation) };
}

/** The inverse; its rows are cross products of the columns. */
export function inverse({ linear: m, translation }) {
  const [x, y, z] = [0, 3, 6].map((c) => m.slice(c, c + 3));
  const rows = [cross(y, z), cross(z, x), cross(x, y)].map((r) => scale(r, 1 / dot(x, cross(y, z))));
  const linear = [0, 1, 2].flatMap((i) => rows.map((r) => r[i]));
  return { linear, translation: rows.map((r) => -dot(r, translation)) };
}

export const IDENTITY = { linear: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0] };

/** The transform, and then a rotation about an axis through a point. */
export function rotated({ linear, translation }, axis, angle, pivot) {
  const columns = [0, 3, 6].flatMap((c) => turn(linear.slice(c, c + 3), axis, angle));
  return { linear: columns, translation: add(pivot, turn(sub(translation, pivot), axis, angle)) };
}

/** The transform, and then a scaling about a point. */
export function scaled({ linear, translation }, factor, pivot) {
  return { linear: linear.map((v) => v * factor), translation: add(pivot, scale(sub(translation, pivot), factor)) };
}

/** Two axes that lie flat: across, and away from it. */
function flat(up) {
  const across = unit(cross(up, Math.abs(up[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
  return [across, cross(up, across)];
}

/** A unit direction's angles: about the upright, and above the horizon; degrees. */
export function angles(direction, up) {
  const [across, away] = flat(up);
  const degrees = 180 / Math.PI;
  const tilt = Math.asin(Math.max(-1, Math.min(1, dot(direction, up)))) * degrees;
  return [Math.atan2(dot(direction, away), dot(direction, across)) * degrees, tilt];
}

/** The unit direction of such angles; never quite upright, where the first would be forgotten. */
export function direction([about, above], up) {
  const [across, away] = flat(up);
  const a = (about * Math.PI) / 180, t = (Math.max(-89.9, Math.min(89.9, above)) * Math.PI) / 180;
  return add(scale(up, Math.sin(t)), scale(add(scale(across, Math.cos(a)), scale(away, Math.sin(a))), Math.cos(t)));
}

/** A camera made ready to project: the same arithmetic as the master's. */
export function lens({ origin, target, up, fov_y_deg, width, height, two_point = false }) {
  const towards = sub(target, origin), upright = unit(up);
  const level = sub(towards, scale(upright, dot(towards, upright)));
  const forward = unit(two_point ? level : towards);
  // As far as a lens shifts: scenes/src/camera.rs.
  const slope = two_point ? Math.max(-1.732, Math.min(1.732, dot(towards, upright) / length(level))) : 0;
  const right = unit(cross(forward, up));
  const down = cross(forward, right);
  const pixel = 2 * Math.tan((fov_y_deg * Math.PI) / 360) / height;
  return {
    origin, forward, right, down, pixel,
    /** Where a point is seen, 0..1 of the picture, and its depth; nothing behind the eye. What a plan cuts away is told as well. */
    project(point) {
      const offset = sub(point, origin);
      const depth = dot(offset, forward);
      if (!(depth > 1e-6)) return null;
      const s = 1 / (depth * pixel);
      return { x: (dot(offset, right) * s + width / 2) / width, y: (dot(offset, down) * s + height / 2 + slope / pixel) / height, depth };
    },
  };
}

const encode = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
const decode = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);

/** A linear colour as #rrggbb, its largest channel at most 1. */
export function hex(rgb) {
  const most = Math.max(1, ...rgb);
  return "#" + rgb.map((v) => Math.round(255 * Math.min(1, encode(Math.max(0, v / most)))).toString(16).padStart(2, "0")).join("");
}

/** #rrggbb as a linear colour. */
export const unhex = (text) => [1, 3, 5].map((i) => decode(parseInt(text.slice(i, i + 2), 16) / 255));
