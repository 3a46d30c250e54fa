// Objects, and pieces of objects, as things that stand somewhere and can be moved and hidden.

import { IDENTITY, after, inverse } from "./vector.js";

/** A piece that the page has met; pieces of an object are named by numbers. */
export function findPiece(scene, { object, piece }) {
  return scene.pieces.find((p) => p.object === object && p.piece === piece);
}

export const isSame = (a, b) => a?.kind === b?.kind && a?.index === b?.index && a?.object === b?.object && a?.piece === b?.piece;

/** What of a kind of material an object or a piece of it has (`piece` null: the object): its own, or else its whole's own, or
 *  else what all have that are made of it. */
export function madeOf(scene, object, piece, material) {
  const own = piece == null ? null : findPiece(scene, { object, piece })?.own;
  const found = [own, scene.objects[object]?.own].map((list) => list?.find(([of]) => of === material)).find(Boolean);
  return found ? found[1] : scene.materials[material];
}

/** The change that makes a thing alone of another material. */
export function changeMaterial({ kind, index, object, piece }, material, value) {
  return { OwnMaterial: kind === "object" ? { object: index, piece: null, material, value } : { object, piece, material, value } };
}

/** Makes such a change in the page's copy of the scene. */
export function learnMaterial(scene, { object, piece, material, value }) {
  const it = piece == null ? scene.objects[object] : findPiece(scene, { object, piece });
  if (!it) return;
  it.own = it.own.filter(([of]) => of !== material);
  if (value) it.own.push([material, value]);
}

/** By what a colour is kept that a material of a thing's own had before it was turned off. */
export const ownKey = ({ object, piece, material }) => `${object}/${piece ?? "all"}/${material}`;

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
export const putBack = (scene, { object, piece }) => [
  { PieceTransform: { object, piece, whole_from_piece: IDENTITY } }, { PieceVisible: { object, piece, visible: true } },
  ...(findPiece(scene, { object, piece })?.own ?? []).map(([material]) => ({ OwnMaterial: { object, piece, material, value: null } })),
];

/** Something was done to it. */
export const isLifted = ({ place, visible, own }) => !visible || own.length > 0 || JSON.stringify(place) !== JSON.stringify(IDENTITY);
