// How the scene is seen: in perspective, with what is upright kept upright, or in parallel as a plan or a section.

import { add, apply, dot, length, scale, sub, unit } from "./vector.js";

/** So many times half its picture's height is the eye away from a plan, as in scenes/src/camera.rs. */
const PARALLEL_HEIGHTS = 500;
const PARALLEL_DEG = (2 * Math.atan(1 / PARALLEL_HEIGHTS) * 180) / Math.PI;
/** Of a plan, so much of the picture is margin. */
const MARGIN = 0.08;

/** Where each looks, and what is upright in its picture. */
const SIDES = {
  plan: [[0, -1, 0], [0, 0, -1]], "-z": [[0, 0, -1], [0, 1, 0]], "+z": [[0, 0, 1], [0, 1, 0]], "-x": [[-1, 0, 0], [0, 1, 0]], "+x": [[1, 0, 0], [0, 1, 0]],
};

/** Which of them a camera is. */
export function projectionOf({ origin, target, two_point, cut }) {
  if (!cut) return two_point ? "two_point" : "perspective";
  const forward = unit(sub(target, origin));
  const [nearest] = Object.entries(SIDES).sort(([, [a]], [, [b]]) => dot(b, forward) - dot(a, forward));
  return nearest[0];
}

/** Least and greatest corner of all that is visible. */
function bounds(scene) {
  const corners = scene.objects.filter((o) => o.box && o.visible).flatMap((o) => [...Array(8).keys()].map((i) => apply(o.place, [0, 1, 2].map((a) => o.box[(i >> a) & 1][a]))));
  if (corners.length === 0) return [[-1, -1, -1], [1, 1, 1]];
  return [Math.min, Math.max].map((of) => [0, 1, 2].map((axis) => of(...corners.map((corner) => corner[axis]))));
}

/** The camera that sees so, where people stand as `stood` does. Plans are cut at the height of their eyes, sections where they look. */
export function seenAs(kind, stood, scene, shape) {
  const side = SIDES[kind];
  if (!side) return { ...stood, two_point: kind === "two_point", cut: false };
  const [forward, up] = side, [least, greatest] = bounds(scene);
  const right = [0, 1, 2].map((i) => forward[(i + 1) % 3] * up[(i + 2) % 3] - forward[(i + 2) % 3] * up[(i + 1) % 3]);
  const size = sub(greatest, least), along = (axis) => Math.abs(dot(size, axis));
  const height = (1 + 2 * MARGIN) * Math.max(along(up), along(right) / shape, 1e-3);
  const middle = scale(add(least, greatest), 0.5);
  const wanted = dot(kind === "plan" ? stood.origin : stood.target, forward), ends = [dot(least, forward), dot(greatest, forward)].sort((a, b) => a - b);
  const at = wanted > ends[0] && wanted < ends[1] ? wanted : dot(middle, forward);
  const target = add(middle, scale(forward, at - dot(middle, forward)));
  return { ...stood, target, origin: sub(target, scale(forward, (PARALLEL_HEIGHTS * height) / 2)), up, fov_y_deg: PARALLEL_DEG, two_point: false, cut: true };
}

/** Somewhere to stand, for whoever comes to a plan first. */
export function perspective(scene, camera) {
  const [least, greatest] = bounds(scene), middle = scale(add(least, greatest), 0.5), far = length(sub(greatest, least));
  return { ...camera, origin: add(middle, [0.5 * far, 0.3 * far, 0.8 * far]), target: middle, up: [0, 1, 0], fov_y_deg: 45, two_point: false, cut: false };
}

/** The axis that a cut is measured on, and which way. */
function axisOf(camera) {
  const [forward] = SIDES[projectionOf(camera)];
  return forward.map(Math.abs);
}

/** Where on its axis a camera's cut is. */
export const cutOf = (camera) => dot(camera.target, axisOf(camera));
/** How far the scene reaches on that axis. */
export const reach = (scene, camera) => bounds(scene).map((corner) => dot(corner, axisOf(camera)));
/** The camera with its cut elsewhere. */
export function cutAt(camera, at) {
  const by = scale(axisOf(camera), at - cutOf(camera));
  return { ...camera, origin: add(camera.origin, by), target: add(camera.target, by) };
}
