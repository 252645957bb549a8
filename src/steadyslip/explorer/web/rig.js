// Rig of a page: values and their domains, status, checks against Python, links and rig files.
import { ABSENT, Linear, UNKNOWN } from "./linear.js";
import { about } from "./nearness.js";
import { exactly, tellIn } from "./quantities.js";

/**
 * @typedef {{name: string, title: string, letter: string, unit: string, factor: number, value: number, natural: number, doc: string,
 *   low: number | null, high: number | null, lowAllowed: boolean, highAllowed: boolean, whole: boolean,
 *   allowed: string, own: [string, number, string], si?: string, was?: number}} Parameter `own`: unit, its SI size and the text of the value in the user's file
 * @typedef {{title: string, version: string, parameters: Parameter[], facts: any, places: (number | string)[], fixed: number[],
 *   axial: number, toml: any[], branch: number, checks: any[], speed: string, area: number | null, stiffnessArea: number | null,
 *   stiffness: string | null, remote: number, written: Record<string, [string, number][]>, areas?: number[], levers?: string[], phrases?: any, reasons?: any, headlines: any, absent: any, motion: any, still: string, sketch: string,
 *   pace: any, columns: string[], aperiodic: string, beyond: any, ends: any, means: string, usual: any}} Data
 * @typedef {{at: (position: number) => number, of: (value: number) => number}} Scale positions from 0 to 1
 */

export const NEW = /** @type {[string, number, string]} */ (["", 1, ""]); // source of a parameter that the user's file leaves out

export class Rig {
  /** @param {Data} data @param {any} programs */
  constructor(data, programs) {
    this.data = data;
    tellIn(data.written);
    for (const one of data.parameters) Object.assign(one, { own: NEW, ...data.usual, .../** @type {any} */ (one) });
    data.facts.parameters = data.places.map((at) => (typeof at === "string" ? at : data.parameters[at].name));
    this.linear = new Linear(programs, data.facts);
    this.values = data.parameters.map((one) => one.value);
    this.vector = new Float64Array(data.facts.parameters.length);
    this.trial = new Float64Array(data.parameters.length);
    this.spring = data.facts.parameters.indexOf("slider.stiffness");
    this.bar = data.parameters.findIndex((one) => one.name === data.stiffness);
  }

  /** Parameters of the Model for values of the page. @param {ArrayLike<number>} values */
  set(values) {
    const { places, fixed, axial } = this.data, model = this.vector;
    for (let k = 0; k < model.length; k++) model[k] = values[places[k]] ?? fixed[k];
    this.linear.set(model);
    if (axial >= 0) {
      model[this.spring] = values[axial] * this.linear.ask("stiffness", 1)[0];
      this.linear.set(model);
    }
    return this.linear;
  }

  /** Index of the parameter on the bar; the stiffness for sliders. */
  get bar() {
    return this.told;
  }

  set bar(i) {
    const { phrases, facts, parameters } = this.data;
    this.told = i;
    if (phrases) this.linear.bar = i < 0 ? -1 : facts.parameters.indexOf(parameters[i].name);
  }

  /** @param {number[]} [values] */
  assess(values = this.values) {
    return this.set(values).assess(this.data.branch);
  }

  /** Status with one or two values changed. @param {number} i @param {number} x @param {number} [j] @param {number} [y] */
  status(i, x, j = -1, y = 0) {
    const parameter = this.data.parameters[i];
    if (!inside(parameter, x) || (j >= 0 && !inside(this.data.parameters[j], y))) return UNKNOWN;
    this.trial.set(this.values);
    this.trial[i] = x;
    if (j >= 0) this.trial[j] = y;
    return this.set(this.trial).status(this.data.branch);
  }

  /** What contours show with two values changed; NaN without steady sliding. @param {number} i @param {number} x @param {number} j @param {number} y */
  strength(i, x, j, y) {
    const status = this.status(i, x, j, y);
    return status === ABSENT || status === UNKNOWN ? NaN : this.linear.strength(this.data.branch);
  }

  /** True if the status depends on rounding, with one value changed. @param {number} i @param {number} x */
  onEdge(i, x) {
    this.trial.set(this.values);
    this.trial[i] = x;
    return inside(this.data.parameters[i], x) && this.set(this.trial).onEdge(this.data.branch);
  }

  /** Values of a parameter, rising, with a root on the imaginary axis; null if it does not enter linearly. @param {number} i */
  crossings(i) {
    const { name, low } = this.data.parameters[i], place = i === this.data.axial ? this.spring : this.data.facts.parameters.indexOf(name);
    return low === null || low < 0 ? null : this.set(this.values).crossings(place, this.data.branch)?.map((factor) => factor * this.values[i]) ?? null;
  }

  /** True if these are the present values. @param {number[]} values */
  has(values) {
    return values.every((value, i) => Object.is(value, this.values[i]));
  }

  /** Differences from the answers of Python stored in the page, in words. */
  differences() {
    const found = /** @type {string[]} */ ([]);
    for (const check of this.data.checks) {
      const answer = this.assess(Object.assign(this.values.slice(), check.values)), { name } = check;
      if (answer.status !== check.status) found.push(`${name}: the verdict`);
      if (check.critical !== null && !near(answer.critical, check.critical)) found.push(`${name}: the critical stiffness`);
      const same = check.eigenvalues.length === answer.eigenvalues.length &&
        check.eigenvalues.every(([re, im], i) => {
          const s = answer.eigenvalues[i];
          return Math.hypot(s.re - re, s.im - im) <= 1e-9 * Math.hypot(re, im);
        });
      if (!same) found.push(`${name}: the eigenvalues`);
    }
    return found;
  }

  /** Text of the rig file with the present values; the rest of the user's file is kept (see own_file.py). */
  toml() {
    const line = ([i, before, behind, end = ""]) => (end && Object.is(this.values[i], this.data.parameters[i].value) ? "" : before + this.values[i] + behind + end);
    return this.data.toml.map((piece) => {
      if (typeof piece === "string") return piece;
      if (!piece.head && piece.head !== "") return piece.length > 1 ? line(piece) : this.written(piece[0]);
      const lines = piece.lines.map(line).join("");
      return lines && piece.head + lines;
    }).join("");
  }

  /** Text of a value in the unit of the user's file, or in SI units if only these keep all digits. @param {number} i */
  written(i) {
    const one = this.data.parameters[i], { own: [unit, size, text], factor, si, was = one.value } = one, value = this.values[i];
    if (Object.is(value, was)) return text;
    for (let many = 1; many <= 17 && !one.whole; many++) {
      const digits = String(Number(((value * factor) / size).toPrecision(many)));
      if (exactly(digits, size) / factor === value) return unit ? `"${digits} ${unit}"` : digits;
    }
    return one.whole || (si ?? one.unit) === "1" ? String(value) : `"${value} ${si ?? one.unit}"`;
  }

  /** Text of a link: changed values and choices. @param {string[]} [chosen] */
  hash(chosen = []) {
    const changed = this.data.parameters.flatMap((one, i) => (Object.is(this.values[i], one.value) ? [] : [`${encodeURIComponent(one.name)}=${this.values[i]}`]));
    return changed.length + chosen.length ? `#${[...changed, ...chosen].join("&")}` : "";
  }

  /** Values from a link (known names, numbers within their domains), and the refused parts in words. */
  fromHash(text) {
    const values = this.data.parameters.map((one) => one.value), left = /** @type {string[]} */ ([]);
    for (const part of text.slice(0, 10000).replace(/^#/, "").split("&")) {
      if (part.startsWith("~")) continue; // choices, see view.js
      const [name, number, ...more] = part.split("=");
      const i = this.data.parameters.findIndex((one) => encodeURIComponent(one.name) === name);
      const value = number && /^-?\d+(\.\d+)?(e[-+]?\d+)?$/i.test(number) ? Number(number) : NaN;
      if (!more.length && i >= 0 && inside(this.data.parameters[i], value)) values[i] = value;
      else if (number !== undefined) left.push(i < 0 ? name.slice(0, 40) : `${name} = ${number.slice(0, 20)} (allowed: ${this.data.parameters[i].allowed})`);
    }
    return { values, left };
  }
}

const near = (a, b) => a !== null && Math.abs(a - b) <= 1e-11 * Math.abs(b);

/** True if a value is in the domain of a parameter. @param {Parameter} one @param {number} value */
export function inside(one, value) {
  if (!Number.isFinite(value) || (one.whole && !Number.isInteger(value))) return false;
  const above = one.low === null || (one.lowAllowed ? value >= one.low : value > one.low);
  return above && (one.high === null || (one.highAllowed ? value <= one.high : value < one.high));
}

const SPREAD = 8; // sizes of a value within which edges are drawn on its track, if it may be negative: on a linear scale one further off leaves no room for the rest
const ZERO = 0.04; // share of a logarithmic scale that stands for zero

/** Scale with positions 0 to 1 for the values of a range: logarithmic or linear, as suits the parameter. */
export function scaleOf(one, low, high) {
  if ((one.low !== null && one.high !== null) || low < 0) {
    return { at: (t) => low + t * (high - low), of: (v) => (v - low) / (high - low) };
  }
  const from = one.value === 0 && one.lowAllowed ? ZERO : 0, ratio = Math.log(high / low);
  return {
    at: (t) => (t < from ? 0 : low * Math.exp(((t - from) / (1 - from)) * ratio)),
    of: (v) => (v <= 0 ? 0 : Math.max(0, from + (1 - from) * (Math.log(v / low) / ratio))),
  };
}

/**
 * Initial range of a slider: the domain if bounded, otherwise some decades that contain the nearest edge.
 * @param {Parameter} one @param {number} value @param {number[]} edges
 * @returns {[number, number]}
 */
export function rangeOf(one, value, edges) {
  if (one.low !== null && one.high !== null) {
    const inset = 1e-6 * (one.high - one.low);
    return [one.lowAllowed ? one.low : one.low + inset, one.highAllowed ? one.high : one.high - inset];
  }
  const size = Math.abs(value) || one.natural, above = edges.filter((at) => at > 0);
  if (one.low === null || one.low < 0) {
    const [low, high] = value > 0 ? [-size, 4 * size] : [-4 * size, value < 0 ? size : 4 * size], near = edges.filter((at) => Math.abs(at - value) <= SPREAD * size), room = 0.5 * size;
    return [Math.min(low, ...near.map((at) => at - room)), Math.max(high, ...near.map((at) => at + room))];
  }
  if (value === 0) return above.length ? [above[0] * 1e-2, above[0] * 30] : [size * 1e-3, size * 1e2];
  const nearest = nearestOf(above, size) ?? size;
  return [Math.min(size / 30, nearest / 3), Math.max(size * 30, nearest * 3)];
}

/** Positive value nearest to a size, by ratio. @param {number[]} values @param {number} size */
export const nearestOf = (values, size) => about(values, (x) => x, size)[0];
