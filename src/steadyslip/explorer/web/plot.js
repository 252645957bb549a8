// Axes and curves as SVG: positions run from 0 to 1, boxes are in units of the drawing.
import { svg } from "./dom.js";
import { digits, raised, unitFor } from "./quantities.js";
import { NEW } from "./rig.js";

/**
 * @typedef {{left: number, top: number, width: number, height: number}} Box
 * @typedef {{at: (position: number) => number, of: (value: number) => number}} Scale
 * @typedef {{scale: Scale, range: [number, number], logarithmic: boolean}} Span
 */

const LETTER = 7.5, MARGIN = 40, DIGIT = 7.8, LABELLED = 24; // LETTER, DIGIT: width of a letter of a label and of a figure of a number; MARGIN: how much a label may be longer than its axis; LABELLED: width of an upright label with its gaps, SVG units

/** Round numbers between two numbers, for ticks. */
export function ticks(low, high, logarithmic, most) {
  const found = [];
  if (logarithmic && low > 0 && high < Infinity) {
    const every = Math.max(1, Math.ceil(Math.log10(high / low) / most));
    const steps = Math.log10(high / low) < 1.5 ? [1, 2, 5] : [1];
    for (let n = Math.floor(Math.log10(low)); n <= Math.log10(high); n++) {
      for (const step of steps) {
        const value = step * 10 ** n;
        if (n % every === 0 && value >= low && value <= high) found.push(value);
      }
    }
    return found;
  }
  const raw = (high - low) / most, size = 10 ** Math.floor(Math.log10(raw));
  const step = size * ([1, 2, 2.5, 5, 10].find((s) => s * size >= raw * 0.9999) ?? 10);
  if (!(step > 0) || !Number.isFinite(step)) return found;
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high * (1 + 1e-12) + 1e-9 * step && found.length < 50; n++) found.push(n * step);
  return found;
}

/** Text of a number as a power of ten, such as 10⁶ or 2·10⁶. @param {number} value */
function inPowers(value) {
  const power = Math.floor(Math.log10(value) + 1e-9), first = digits(value / 10 ** power, 3);
  return power === 0 || power === 1 ? digits(value, 3) : `${first === "1" ? "" : `${first}·`}10${raised(String(power))}`;
}

/** Axis with ticks, numbers and label, in the unit of `one` or a readable one. @param {any} one name, unit and factor */
export function axis(box, scale, [low, high], one, label, upright) {
  const logarithmic = low > 0 && high / low > 30 && scale.of(0.5 * (low + high)) > 0.6;
  const [factor, name] = unitFor({ factor: 1, own: NEW, ...one }, Math.max(Math.abs(low), Math.abs(high)) / (logarithmic ? Math.sqrt(high / low) : 1));
  const group = svg("g", { class: "axis" }), length = upright ? box.height : box.width;
  const ends = [low / factor, high / factor], most = length / (upright ? 40 : 80);
  let marks = ticks(...ends, logarithmic, most);
  if (marks.length < 2) marks = ticks(...ends, false, 2 * most); // one number tells no scale
  const many = Math.min(12, Math.max(3, Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high)) / (Math.abs(high - low) || 1))) + 3)); // digits that distinguish the ticks
  const powers = logarithmic && marks.some((value) => digits(value, 3).includes("×"));
  for (const value of marks) {
    const at = scale.of(value * factor);
    if (at < -1e-9 || at > 1 + 1e-9) continue;
    const x = box.left + (upright ? 0 : at * box.width), y = box.top + (upright ? (1 - at) * box.height : box.height);
    const number = powers ? inPowers(value) : digits(value, logarithmic ? 3 : many), room = box.left - LABELLED;
    const narrow = upright && number.length * DIGIT > room ? { textLength: room, lengthAdjust: "spacingAndGlyphs" } : {};
    group.append(
      svg("line", { x1: x, y1: y, x2: upright ? box.left + box.width : x, y2: upright ? y : box.top, class: "grid" }),
      svg("text", { x: upright ? x - 6 : x, y: upright ? y + 4 : y + 16, "text-anchor": upright ? "end" : "middle", ...narrow }, number),
    );
  }
  let own = label;
  const whole = () => (name ? `${own} (${name})` : own);
  while (whole().length * LETTER > length + MARGIN && own.includes(".")) own = own.slice(own.indexOf(".") + 1); // a long name loses its first parts
  const text = whole();
  const where = upright ? { transform: `translate(13 ${box.top + box.height / 2}) rotate(-90)` } : { x: box.left + box.width / 2, y: box.top + box.height + 34 };
  const [, base = text, below, rest] = /^(.*?)_(\w+)(.*)$/.exec(text) ?? []; // a letter's subscript stands below the line
  group.append(svg("text", { ...where, "text-anchor": "middle", class: "label" }, base, ...(below ? [svg("tspan", { dy: 4, "font-size": "80%" }, below), svg("tspan", { dy: -4 }, rest)] : [])));
  return group;
}

/** Lowest and highest finite value of several series; [0, 1] if there are none. @param {ArrayLike<number>[]} all @returns {[number, number]} */
export function extent(...all) {
  let low = Infinity, high = -Infinity;
  for (const values of all) {
    for (let i = 0; i < values.length; i++) {
      if (values[i] < low && values[i] > -Infinity) low = values[i];
      if (values[i] > high && values[i] < Infinity) high = values[i];
    }
  }
  return low <= high ? [low, high] : [0, 1];
}

/** Scale for values from low to high with a margin; logarithmic for positive velocities that span decades. @returns {Span} */
export function spanning([low, high], label) {
  if (label === "velocity" && low > 0 && high / low > 30) {
    const a = low / 1.15, b = high * 1.15, along = straight(Math.log(a), Math.log(b)); // logarithms, as b / a may overflow
    return { scale: { at: (t) => Math.exp(along.at(t)), of: (v) => along.of(Math.log(v)) }, range: [a, b], logarithmic: true };
  }
  const room = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1, a = low - room, b = high + room;
  return { scale: straight(a, b), range: [a, b], logarithmic: false };
}

/** @returns {Scale} */
export const straight = (a, b) => ({ at: (t) => a + t * (b - a), of: (v) => (v - a) / (b - a) });

export const frame = (box) => svg("rect", { x: box.left, y: box.top, width: box.width, height: box.height, class: "frame" });

/** SVG path of a series over rising times; of many points only the lowest and highest of each pixel column. */
export function pathOver(box, times, values, along, up) {
  let path = "", column = -1, least = 0, most = 0, pen = "M", outside = /** @type {number[]} */ ([]);
  const put = (x, y) => {
    path += `${pen}${x.toFixed(1)} ${y.toFixed(1)}`;
    pen = "L";
  };
  const few = times.length < 3 * box.width, clipped = (y) => Math.min(box.top + box.height, Math.max(box.top, y));
  for (let i = 0; i < times.length; i++) {
    const x = box.left + along.of(times[i]) * box.width, y = clipped(box.top + (1 - up.of(values[i])) * box.height);
    if (x > box.left + box.width + 0.1) break;
    if (!Number.isFinite(x) || Number.isNaN(y)) { // a gap
      [pen, column, outside] = ["M", -1, []];
      continue;
    }
    if (x < box.left) {
      outside = [x, y];
      continue;
    }
    if (outside.length) { // begin at the frame
      put(box.left, outside[1] + ((y - outside[1]) * (box.left - outside[0])) / (x - outside[0]));
      outside = [];
    }
    if (Math.floor(x) !== column) {
      if (column >= 0 && most > least) put(column + 0.5, least), put(column + 0.5, most);
      [column, least, most] = [Math.floor(x), y, y];
      put(x, y);
    } else {
      [least, most] = [Math.min(least, y), Math.max(most, y)];
      if (few) put(x, y);
    }
  }
  return path;
}

/** Strip chart over time: axes and curves, faint ones first. @param {{times: any, values: any}[]} curves */
export function strip(box, curves, [from, until], unit, label, last) {
  const up = spanning(extent(...curves.map((one) => one.values)), label), along = straight(from, until);
  const group = svg("g", {}, axis(box, up.scale, up.range, { unit }, label, true));
  if (last) group.append(axis(box, along, [from, until], { unit: "s" }, "time", false));
  group.append(frame(box));
  curves.forEach((one, n) => group.append(svg("path", { class: n + 1 < curves.length ? "curve before" : "curve", d: pathOver(box, one.times, one.values, along, up.scale) })));
  return { group, up: up.scale };
}

/** SVG path of one series over another, without points closer than half a unit or pieces drawn before. */
export function pathThrough(box, xs, ys, across, up) {
  const wide = 2 * Math.ceil(box.width) + 3, drawn = new Uint8Array(wide * (2 * Math.ceil(box.height) + 3)); // cells of half a unit, 1 where something is drawn
  let path = "", lastX = NaN, lastY = NaN, down = false; // true if the path ends at the last point
  const isNew = (x, y) => { // true if the segment to a point crosses an empty cell
    const steps = Math.ceil(2 * Math.max(Math.abs(x - lastX), Math.abs(y - lastY)));
    let found = false;
    for (let k = 0; k <= steps; k++) {
      const part = k / steps, cell = Math.floor(2 * (lastX + part * (x - lastX) - box.left)) + wide * Math.floor(2 * (lastY + part * (y - lastY) - box.top));
      if (!drawn[cell]) found = true;
      drawn[cell] = 1;
    }
    return found;
  };
  for (let i = 0; i < xs.length; i++) {
    const x = box.left + across.of(xs[i]) * box.width, y = box.top + (1 - up.of(ys[i])) * box.height;
    if (Math.abs(x - lastX) + Math.abs(y - lastY) < 0.5 || !Number.isFinite(x + y)) continue;
    if (!Number.isNaN(lastX) && isNew(x, y)) {
      if (!down) path += `M${lastX.toFixed(1)} ${lastY.toFixed(1)}`;
      path += `L${x.toFixed(1)} ${y.toFixed(1)}`;
      down = true;
    } else down = false;
    [lastX, lastY] = [x, y];
  }
  return path;
}

/** Phase plane: axes and curves of one series over another. @param {{x: any, y: any}[]} curves @param {[string, string]} upIs */
export function plane(box, curves, [unit, label], upIs) {
  const across = spanning(extent(...curves.map((one) => one.x)), label), up = spanning(extent(...curves.map((one) => one.y)), upIs[1]);
  const group = svg("g", {}, axis(box, across.scale, across.range, { unit }, label, false), axis(box, up.scale, up.range, { unit: upIs[0] }, upIs[1], true), frame(box));
  curves.forEach((one, n) => group.append(svg("path", { class: n + 1 < curves.length ? "curve before" : "curve", d: pathThrough(box, one.x, one.y, across.scale, up.scale) })));
  return { group, across: across.scale, up: up.scale };
}
