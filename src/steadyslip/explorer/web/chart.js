// A chart of stability in two parameters, as SVG: regions by rows, their outline by marching squares.
import { ABSENT, STABLE, UNKNOWN, UNSTABLE } from "./linear.js";
import { digits, display } from "./quantities.js";

export const CLASSES = { [ABSENT]: "none", [STABLE]: "stable", [UNSTABLE]: "unstable", [UNKNOWN]: "unknown" };
const SVG = "http://www.w3.org/2000/svg";

/** An element of SVG with attributes. @param {string} name @param {Record<string, any>} attributes */
export function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  made.append(...children);
  return made;
}

/** Round numbers between two, positions of ticks. */
export function ticks(low, high, logarithmic, most) {
  const found = [];
  if (logarithmic) {
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
  const step = size * [1, 2, 2.5, 5, 10].find((s) => s * size >= raw * 0.9999);
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high * (1 + 1e-12) + 1e-9 * step; n++) found.push(n * step);
  return found;
}

/**
 * Paths of the regions and of the outline between them.
 * @param {(x: number, y: number) => number} status of positions from 0 to 1
 * @param {number} rows
 */
export function regions(status, rows, width, height) {
  const columns = Math.round(rows * 1.3), grid = [];
  const paths = { stable: "", unstable: "", none: "", unknown: "" };
  const cut = (at, a, b, first) => { // between two positions of different status
    for (let step = 0; step < 10; step++) {
      const middle = 0.5 * (a + b);
      if (at(middle) === first) a = middle;
      else b = middle;
    }
    return 0.5 * (a + b);
  };
  for (let j = 0; j <= rows; j++) grid.push(Array.from({ length: columns + 1 }, (_, i) => status(i / columns, j / rows)));
  const top = (y) => ((1 - y) * height).toFixed(1), left = (x) => (x * width).toFixed(1);
  let outline = "";
  const acrossRow = (j, i) => cut((x) => status(x, j / rows), i / columns, (i + 1) / columns, grid[j][i]);
  const upColumn = (j, i) => cut((y) => status(i / columns, y), j / rows, (j + 1) / rows, grid[j][i]);
  for (let j = 0; j < rows; j++) {
    for (let i = 0; i < columns; i++) {
      const a = grid[j][i], b = grid[j][i + 1], c = grid[j + 1][i + 1], d = grid[j + 1][i];
      if (a === b && b === c && c === d) continue;
      const points = [];
      if (a !== b) points.push([acrossRow(j, i), j / rows]);
      if (b !== c) points.push([(i + 1) / columns, upColumn(j, i + 1)]);
      if (d !== c) points.push([acrossRow(j + 1, i), (j + 1) / rows]);
      if (a !== d) points.push([i / columns, upColumn(j, i)]);
      const ends = points.length === 3 ? [points[0], points[1], points[1], points[2]] : points;
      for (let k = 0; k + 1 < ends.length; k += 2) outline += `M${left(ends[k][0])} ${top(ends[k][1])}L${left(ends[k + 1][0])} ${top(ends[k + 1][1])}`;
    }
  }
  const fine = 2 * rows;
  for (let j = 0; j < fine; j++) {
    const y = (j + 0.5) / fine, low = grid[j >> 1], high = grid[(j >> 1) + 1];
    const high_ = top((j + 1) / fine), low_ = top(j / fine);
    const bar = (a, b, code) => { // half a pixel over the next row, so that no seam shows
      paths[CLASSES[code]] += `M${left(a)} ${high_}H${left(b)}V${(Number(low_) + 0.5).toFixed(1)}H${left(a)}Z`;
    };
    if (low.every((s, i) => s === low[0] && high[i] === low[0])) {
      bar(0, 1, low[0]);
      continue;
    }
    let from = 0, code = status(0, y);
    for (let i = 0; i < columns; i++) {
      const next = status((i + 1) / columns, y);
      if (next === code) continue;
      const x = cut((one) => status(one, y), i / columns, (i + 1) / columns, code);
      bar(from, x, code);
      [from, code] = [x, next];
    }
    bar(from, 1, code);
  }
  return { paths, outline };
}

/** One axis: lines, numbers and label, in a unit that reads well; `area` is what values are shown times. */
export function axis(box, scale, range, area, unit, label, upright) {
  const low = range[0] * area, high = range[1] * area;
  const logarithmic = low > 0 && high / low > 30 && scale.of((0.5 * (low + high)) / area) > 0.6;
  const [factor, name] = display(Math.max(Math.abs(low), Math.abs(high)) / (logarithmic ? Math.sqrt(high / low) : 1), unit);
  const group = svg("g", { class: "axis" }), length = upright ? box.height : box.width;
  for (const value of ticks(low / factor, high / factor, logarithmic, length / (upright ? 40 : 80))) {
    const at = scale.of((value * factor) / area);
    if (at < -1e-9 || at > 1 + 1e-9) continue;
    const x = box.left + (upright ? 0 : at * box.width), y = box.top + (upright ? (1 - at) * box.height : box.height);
    group.append(
      svg("line", { x1: x, y1: y, x2: upright ? box.left + box.width : x, y2: upright ? y : box.top, class: "grid" }),
      svg("text", { x: upright ? x - 6 : x, y: upright ? y + 4 : y + 16, "text-anchor": upright ? "end" : "middle" }, digits(value, 3)),
    );
  }
  const text = name ? `${label} (${name.replace("^2", "²")})` : label;
  const where = upright ? { transform: `translate(13 ${box.top + box.height / 2}) rotate(-90)` } : { x: box.left + box.width / 2, y: box.top + box.height + 34 };
  group.append(svg("text", { ...where, "text-anchor": "middle", class: "label" }, text));
  return group;
}

/** One strip of a series over time, as elements: axes, curve. @param {ArrayLike<number>} times @param {ArrayLike<number>} values */
export function strip(box, times, values, until, unit, label, last) {
  let low = Infinity, high = -Infinity;
  for (let i = 0; i < values.length; i++) {
    low = Math.min(low, values[i]);
    high = Math.max(high, values[i]);
  }
  const logarithmic = low > 0 && high / low > 30, pad = logarithmic ? 1.15 : 0;
  if (!logarithmic) {
    const room = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1;
    [low, high] = [low - room, high + room];
  } else [low, high] = [low / pad, high * pad];
  const up = logarithmic ? { at: (t) => low * (high / low) ** t, of: (v) => Math.log(v / low) / Math.log(high / low) }
    : { at: (t) => low + t * (high - low), of: (v) => (v - low) / (high - low) };
  const along = { at: (t) => t * until, of: (v) => v / until }, group = svg("g", {});
  group.append(axis(box, up, [low, high], 1, unit, label, true));
  if (last) group.append(axis(box, along, [0, until], 1, "s", "time", false));
  let path = "", column = -1, least = 0, most = 0;
  const put = (x, y) => (path += `${path ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`);
  for (let i = 0; i < times.length; i++) { // lowest and highest of each column of pixels
    const x = box.left + along.of(times[i]) * box.width, y = box.top + (1 - up.of(values[i])) * box.height;
    if (Math.floor(x) !== column) {
      if (column >= 0 && most > least) put(column + 0.5, least), put(column + 0.5, most);
      [column, least, most] = [Math.floor(x), y, y];
      put(x, y);
    } else {
      [least, most] = [Math.min(least, y), Math.max(most, y)];
      if (times.length < 3 * box.width) put(x, y);
    }
  }
  group.append(svg("rect", { x: box.left, y: box.top, width: box.width, height: box.height, class: "frame" }), svg("path", { class: "curve", d: path }));
  return group;
}
