// Quantities as people type and read them: a number, a prefix of thousands, a unit. One parser for every field.

import { short } from "./number.js";

const ALIASES = {
  lux: "lx", lumen: "lm", lumens: "lm", candela: "cd", kelvin: "K", watt: "W", watts: "W", nit: "cd/m²", nits: "cd/m²",
  "cd/m2": "cd/m²", "cd/m^2": "cd/m²", deg: "°", degree: "°", degrees: "°", stop: "EV", stops: "EV", percent: "%",
};
const PREFIXES = { k: 1e3, M: 1e6, m: 1e-3 };
/** 12, -1.5, 1,5, .5, 2e3, 67 332; the point or comma before what is less than one. */
const NUMBER = /^([+-]?)(\d{1,3}(?:[ '\u00a0\u202f]\d{3})+(?:[.,]\d+)?|\d+(?:[.,]\d*)?|[.,]\d+)(e[+-]?\d+)?/i;

/** What was typed, in the field's own measure; null if it is no quantity. `units`: the size of each unit that the field
 *  knows in that measure, or a function of the number; `shown`: the unit of a bare number. 1,200 is twelve hundred to some
 *  and little more than one to others: it is refused. */
export function parse(text, units = {}, shown = "") {
  const typed = text.trim();
  const found = NUMBER.exec(typed);
  if (!found) return null;
  const [whole, sign, digits, power = ""] = found;
  if (/^[1-9]\d{0,2},\d{3}$/.test(digits)) return null;
  const number = Number(sign + digits.replace(/[ '\u00a0\u202f]/g, "").replace(",", ".") + power);
  const size = sizeOf(typed.slice(whole.length).trim() || shown, units);
  const value = typeof size === "function" ? size(number) : number * size;
  return size != null && Number.isFinite(value) ? value : null;
}

function sizeOf(unit, units) {
  const named = (name) => {
    const known = units[name] ?? units[ALIASES[name.toLowerCase()]];
    return known ?? Object.entries(units).find(([other]) => other.toLowerCase() === name.toLowerCase())?.[1];
  };
  if (unit === "") return 1;
  const plain = named(unit);
  if (plain != null) return plain;
  const factor = PREFIXES[unit[0]], rest = unit.slice(1).trim();
  if (factor == null) return null;
  const size = rest === "" ? 1 : named(rest);
  return typeof size === "number" ? factor * size : null;
}

/** A value in the field's own measure, as it is read in a unit of a plain size. */
export function quantity(value, units = {}, shown = "") {
  const text = short(value / (units[shown] ?? 1));
  return shown === "" ? text : `${text}${shown === "°" ? "" : " "}${shown}`;
}

/** A field for a quantity: `change(value)` once another is typed; what is none is marked, and forgotten when the field is
 *  left. `read(value)` is how it is written; typed values are kept within `min` and `max`. */
export function entry(label, value, { units = {}, shown = "", min = -Infinity, max = Infinity, read, title = "" }, change) {
  const write = read ?? ((v) => quantity(v, units, shown));
  const input = Object.assign(document.createElement("input"), {
    type: "text", className: "quantity", inputMode: "text", autocomplete: "off", spellcheck: false, ariaLabel: `${label}, typed`,
    title: title || (shown ? `Type a number, or one with a unit: ${Object.keys(units).join(", ")}` : "Type a number"),
  });
  /** What the field shows from now on. */
  input.show = (v) => { input.was = v; input.value = write(v); input.ariaInvalid = "false"; };
  input.show(value);
  const read_ = () => parse(input.value, units, shown);
  input.oninput = () => { input.ariaInvalid = String(input.value !== write(input.was) && read_() == null); };
  input.onchange = () => {
    const typed = input.value === write(input.was) ? null : read_();
    if (typed == null) return input.show(input.was);
    input.show(Math.min(max, Math.max(min, typed)));
    change(input.was);
  };
  input.onfocus = () => input.select();
  return input;
}
