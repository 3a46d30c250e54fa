// Objects, and pieces of objects, as things that stand somewhere and can be moved and hidden.

import { IDENTITY, after, inverse } from "./vector.js";

/** A piece that the page has met; pieces of an object are named by numbers. */
export function findPiece(scene, { object, piece }) {
  return scene.pieces.find((p) => p.object === object && p.piece === piece);
}

export const isSame = (a, b) => a?.kind === b?.kind && a?.index === b?.index && a?.object === b?.object && a?.piece === b?.piece;

/** What is selected, as `{ name, place, visible, box, materials }` with its place in the scene; nothing for lamps. */
export function thing(scene, selection) {
  if (selection?.kind === "object") return scene.objects[selection.index];
  const piece = selection?.kind === "piece" && findPiece(scene, selection);
  const whole = piece && scene.objects[piece.object];
  if (!whole) return null;
  const made = piece.materials.map((m) => scene.materials[m]?.name).filter(Boolean).slice(0, 3).join(", ");
  return { ...piece, name: made || `piece ${piece.piece + 1}`, place: after(whole.place, piece.place) };
}

/** The change that puts it there. */
export function changePlace(scene, { kind, index, object, piece }, place) {
  if (kind === "object") return { Transform: { object: index, scene_from_object: place } };
  return { PieceTransform: { object, piece, whole_from_piece: after(inverse(scene.objects[object].place), place) } };
}

/** The change that shows or hides it. */
export function changeVisible({ kind, index, object, piece }, visible) {
  return kind === "object" ? { Visible: { object: index, visible } } : { PieceVisible: { object, piece, visible } };
}

/** The changes that make a piece what it was in the file. */
export const putBack = ({ object, piece }) => [{ PieceTransform: { object, piece, whole_from_piece: IDENTITY } }, { PieceVisible: { object, piece, visible: true } }];

/** Something was done to it. */
export const isLifted = ({ place, visible }) => !visible || JSON.stringify(place) !== JSON.stringify(IDENTITY);
