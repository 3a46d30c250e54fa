// Numbers as people read them.

/** With so many digits that count, and no zeros behind the point that say nothing: 100, -180, 0.25, 12.5. */
export function short(value, digits = 3) {
  const number = Number(value);
  if (!Number.isFinite(number)) return "–";
  const size = Math.abs(number);
  if (size >= 1e7 || (size > 0 && size < 1e-4)) return number.toExponential(digits - 1).replace(/\.?0*e[+]?/, "e");
  const places = size > 0 ? Math.max(0, digits - 1 - Math.floor(Math.log10(size))) : 0;
  const text = number.toFixed(places);
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"]];

/** With a prefix of thousands. */
export function si(value, unit) {
  const [size, letter] = PREFIXES.find(([size]) => value >= size) ?? [1, ""];
  return `${(value / size).toFixed(size > 1 && value < size * 100 ? 1 : 0)} ${letter}${unit}`;
}

export const ms = (value) => (value == null ? "–" : `${value.toFixed(0)} ms`);
