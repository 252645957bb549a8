// Text such as "9 GPa/m" to SI numbers and back: as core/quantities.py and core/format.py do in Python.

/** @type {Record<string, [number, number[]]>} factor, and exponents of kilogram, metre, second and radian */
const TABLE = {
  g: [1e-3, [1, 0, 0, 0]], kg: [1, [1, 0, 0, 0]], t: [1e3, [1, 0, 0, 0]], min: [60, [0, 0, 1, 0]],
  h: [3600, [0, 0, 1, 0]], day: [86400, [0, 0, 1, 0]], days: [86400, [0, 0, 1, 0]], yr: [31557600, [0, 0, 1, 0]],
  bar: [1e5, [1, -1, -2, 0]], rad: [1, [0, 0, 0, 1]], deg: [Math.PI / 180, [0, 0, 0, 1]], arcmin: [Math.PI / 10800, [0, 0, 0, 1]], arcsec: [Math.PI / 648000, [0, 0, 0, 1]], rev: [2 * Math.PI, [0, 0, 0, 1]], turn: [2 * Math.PI, [0, 0, 0, 1]], rpm: [Math.PI / 30, [0, 0, -1, 1]],
  hour: [3600, [0, 0, 1, 0]], year: [31557600, [0, 0, 1, 0]], degree: [Math.PI / 180, [0, 0, 0, 1]], degrees: [Math.PI / 180, [0, 0, 0, 1]],
  "°": [Math.PI / 180, [0, 0, 0, 1]], "%": [0.01, [0, 0, 0, 0]], 1: [1, [0, 0, 0, 0]],
};
/** @type {[string, number[]][]} */
const BASES = [["Pa", [1, -1, -2, 0]], ["N", [1, 1, -2, 0]], ["m", [0, 1, 0, 0]], ["s", [0, 0, 1, 0]], ["Hz", [0, 0, -1, 0]]];
for (const [name, exponents] of BASES) {
  TABLE[name] = [1, exponents];
  const prefixes = { T: 1e12, G: 1e9, M: 1e6, k: 1e3, c: 1e-2, m: 1e-3, u: 1e-6, n: 1e-9, p: 1e-12 };
  for (const [letter, factor] of Object.entries(prefixes)) TABLE[letter + name] ??= [factor, exponents];
}
const RUN_TOGETHER = /(?<![A-Za-z])([TGMkmun]?N|[TGMk]?Pa|kg(?=c?m)|g(?=[cm]m))(m|mm|cm)?(s)?(?![A-Za-z])/g; // Nm, Nms, kgm²
const WORD = /\s*([/*·])?\s*([A-Za-z%°]+|1)\s*(?:\^\s*(-?\d)|(\d))?/y;
const NUMBER = /^\s*([-+−]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+−]?\d+)?)\s*(.*?)\s*$/;
const EITHER = /^[-+−]?[1-9]\d{0,2},\d{3}$/; // ambiguous comma: decimal or thousands separator
const PREFIXED = /^(?:[TGMkcmunp]?(?:Pa|N|m|s|rad)(?:\^?\d)?[\s*/·]*)+$/, SCALED = /^(Pa|N|m|s(?!\/))(?![a-z^])/;
/** @type {[number, string][]} */
const SHOWN = [[1e12, "T"], [1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
/** @type {[number, string][]} */
const LONG = [[31557600, "yr"], [86400, "days"], [3600, "h"], [60, "min"]];

/** Words run together, parted: Nm is N m. @param {string} word @param {any[]} found its parts, where it begins, and all text */
const parted = (word, ...found) => Object.hasOwn(TABLE, word) ? word : found.slice(0, 3).filter(Boolean).join(/\/\s*$/.test(found[4].slice(0, found[3])) ? "/" : " ");

/** SI factor and exponents of a unit. @param {string} text @returns {[number, number[]]} */
export function unitOf(text) {
  const plain = text.replace(/[µμ]/g, "u").replace(/²/g, "^2").replace(/³/g, "^3").replace(RUN_TOGETHER, parted).trim();
  let factor = 1, at = 0;
  const exponents = [0, 0, 0, 0];
  while (at < plain.length) {
    WORD.lastIndex = at;
    const found = WORD.exec(plain), known = found && Object.hasOwn(TABLE, found[2]) && TABLE[found[2]];
    if (!found || !known) throw new Error(`“${text.slice(0, 40)}” is not a unit`);
    const power = Number(found[3] || found[4] || 1) * (found[1] === "/" ? -1 : 1);
    factor *= known[0] ** power;
    known[1].forEach((e, i) => (exponents[i] += power * e));
    at = WORD.lastIndex;
  }
  return [factor, exponents];
}

/** Mantissa and power of ten of a decimal number. @param {string} text @returns {[bigint, number]} */
function decimal(text) {
  const [, sign, whole, part = "", power = "0"] = /^([-+]?)(\d*)\.?(\d*)(?:e([-+]?\d+))?$/i.exec(text) ?? [];
  return [BigInt((sign === "-" ? sign : "") + (whole + part || "0")), Number(power) - part.length];
}

/** Decimal number times a factor, rounded once as in Python: "10 um" is 1e-05. @param {string} digits @param {number} factor */
export function exactly(digits, factor) {
  const [a, m] = decimal(digits), [b, n] = decimal(factor.toExponential());
  return Number(`${a * b}e${m + n}`);
}

/**
 * A quantity in SI units; a bare number counts in the unit that is shown.
 * @param {string} text
 * @param {string} si expected unit
 * @param {string} unit shown now
 * @param {[string, number]} [own] a unit that needs no look-up, and its size
 */
export function parse(text, si, unit, own = ["", 1]) {
  const found = NUMBER.exec(plainly(text.slice(0, 200)));
  if (!found) throw new Error(`“${text.slice(0, 40)}” is not a number with a unit, such as 2.5 ${unit === "1" ? "" : printed(unit)}`.trim());
  if (EITHER.test(found[1])) throw new Error(`“${found[1]}” may be ${found[1].replace(",", ".")} or ${found[1].replace(",", "")}: write it without a comma`);
  const name = found[2] || unit, [factor, exponents] = own[0] && printed(name) === printed(own[0]) ? [own[1], unitOf(si)[1]] : unitOf(name), expected = unitOf(si)[1];
  if (exponents.some((e, i) => e !== expected[i])) throw new Error(`“${name}” has the wrong dimension; expected ${si}`);
  return exactly(found[1].replace(/−/g, "-").replace(",", "."), factor);
}

/** Unit with print typography: µm, m². @param {string} name */
export const printed = (name) => name.replace(/(?<![A-Za-z])[uμ](?=[A-Za-z])/g, "µ").replace(/(?<=[A-Za-z])\^?2(?!\d)/g, "²").replace(/(?<=[A-Za-z])\^?3(?!\d)/g, "³"); // not those of "at 3.2 kN"

/** Unit in a text of number and unit; empty if it has none. @param {string} text */
export const unitIn = (text) => NUMBER.exec(plainly(text.slice(0, 200)))?.[2] ?? "";

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** Digits of a power as superscripts. @param {string} power */
export const raised = (power) => power.replace("-", "⁻").replace(/\d/g, (n) => SUPERSCRIPTS[Number(n)]);

/** Text in which powers of ten are written for a computer: 2e5 for 2 × 10⁵. @param {string} text */
const plainly = (text) => text.replace(/\s*[×*]\s*10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)/, (_, power) => `e${power.replace("⁻", "-").replace(/[⁰¹²³⁴⁵⁶⁷⁸⁹]/g, (n) => SUPERSCRIPTS.indexOf(n))}`);

/** Text of a number with few digits. @param {number} value */
export function digits(value, many = 4) {
  const size = Math.abs(value);
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "–" : value > 0 ? "∞" : "−∞";
  const text = size !== 0 && (size >= 1e5 || size < 1e-4) ? value.toExponential(many - 1).replace(/\.?0+e/, "e") : String(Number(value.toPrecision(many)));
  return text.replace("-", "−").replace(/e([+-−]?)(\d+)/, (_, sign, power) => `\u00a0×\u00a010${raised(sign === "+" ? power : `-${power}`)}`);
}

/** Units in which the file of the rig was written, [name, size], by SI unit. @type {Record<string, [string, number][]>} */
const written = {};

/** Tell quantities in these units. @param {Record<string, [string, number][]>} [units] */
export const tellIn = (units) => Object.assign(written, units);

/** True for a number that is not too long in its unit, as in Python. @param {number} number @param {string} name */
const fits = (number, name) => Math.abs(number) >= 1e-3 && Math.abs(number) < (PREFIXED.test(name) ? 1e4 : 1e5);

/** Size and name of a unit, arcsec in place of a thousandth of a degree and deg of 3600 arcsec. @returns {[number, string]} */
function turned(value, size, name) {
  const number = Math.abs(value / size), [part] = name.split("/");
  if (part === "deg" && number > 0 && number < 1e-3) return [size / 3600, name.replace(part, "arcsec")];
  if (part === "arcsec" && number >= 3600 && number < Infinity) return [size * 3600, name.replace(part, "deg")];
  return [size, name];
}

/** Factor and name of the most readable unit for a value. @param {number} value @param {string} si @returns {[number, string]} */
export function display(value, si) {
  if (si === "1") return [1, ""];
  const from10 = ([, size]) => Math.abs(Math.log10(Math.abs(value) / size) - 1), mine = written[si]?.reduce((a, b) => (from10(b) < from10(a) ? b : a));
  if (mine && (!value || !SCALED.test(si) || fits(value / mine[1], mine[0]))) return turned(value, mine[1], mine[0]);
  if (si === "rad") return turned(value, Math.PI / 180, "deg");
  if (si === "m/rad") return [display(value * 2 * Math.PI, "m/rev")[0] / (2 * Math.PI), display(value * 2 * Math.PI, "m/rev")[1]];
  const first = SCALED.exec(si), size = Math.abs(value);
  if (si === "s" && Number.isFinite(size)) for (const [factor, name] of LONG) if (size >= Math.max(600, 2 * factor)) return [factor, name];
  if (!first || !(size > 0) || !Number.isFinite(size)) return [1, si];
  const large = first[0] === "Pa" || first[0] === "N";
  const [factor, letter] = SHOWN.find(([f, l]) => size >= (f < 1e12 ? 0.9999 * f : 1e14) && (f < 10 || large || l === "")) || [1e-9, "n"];
  return size / factor >= 1e-3 && size / factor < 1e5 ? [factor, letter + si] : [1, si];
}

/**
 * What a page's number is divided by, and the unit in which it then is: that of the user's file, unless that has prefixes
 * and the number would be too long in it; else the one in which it reads best.
 * @param {{unit: string, factor: number, own: [string, number, string]}} one @param {number} value @returns {[number, string]}
 */
export function unitFor({ unit, factor, own: [name, own] }, value) {
  const size = Math.abs((value * factor) / own);
  if (name && (!value || !SCALED.test(unit) || !PREFIXED.test(name) || fits(size, name))) {
    const [least, told] = turned(value * factor, own, name);
    return [least / factor, printed(told)];
  }
  const [best, found] = display(value * factor, unit);
  return [best / factor, printed(found)];
}

/** Text of the value of a parameter with its unit. @param {any} one @param {number} value */
export function told(one, value, many = 4) {
  const [size, name] = unitFor(one, value);
  return `${digits(value / size, many)} ${name}`.trim();
}

/** Digits with which two values read differently, as in Python. @param {number} value @param {number} other */
export function apart(value, other) {
  const gap = Math.abs(other - value) / Math.max(Math.abs(value), Math.abs(other));
  return gap > 1e-12 ? Math.min(12, Math.max(4, 1 - Math.floor(Math.log10(gap)))) : 4;
}

/** Text of an SI value with a readable unit. @param {number} value @param {string} si */
export function shown(value, si, many = 4) {
  const [factor, name] = display(value, si);
  return `${digits(value / factor, many)} ${printed(name)}`.trim();
}
