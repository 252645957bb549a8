// Stability chart over two parameters with the point of the rig.
import { HALF_LINE, POINT, carried, line, regions } from "./chart.js";
import { inMenu } from "./controls.js";
import { make, put, putAt, svg } from "./dom.js";
import { CLASSES, UPPER } from "./linear.js";
import { axis, frame } from "./plot.js";
import { digits, told } from "./quantities.js";
import { kindWords } from "./words.js";

const ROWS = 60, ROWS_SEARCHED = 24; // rows of the chart; fewer if σss must be searched, which is slow
const THINNED = 2.5; // factor of fewer rows while a slider moves
const CELLS = 30, FINE = 45, LEVELS = [0.1, 0.2, 0.5, 2, 5, 10]; // of contours: rows of machines and of sliders, and levels of k/k_cr
const FEW = 5; // steps of the search for a contour of a machine on a side of a cell: each is some .2 ms, and the growth rate is smooth
const APART_BY = 40, ROOMY = 16, TIGHT = 6; // APART_BY: distance of a label to all lines that is enough; ROOMY, TIGHT: ones below which further ones and the first are left out, about that of letters from their middle, SVG units
const NUMBERS = 4, AGAIN = 130; // most numbers of a contour, which may be in pieces, and their least distance, SVG units
const FIGURE = 7.4, LINE = 17; // width of a figure of a number and height of its line with its halo, SVG units
const NUDGES = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** True if two boxes, [x, y, half the width, half the height], overlap. @param {number[]} a @param {number[]} b */
const clash = (a, b) => Math.abs(a[0] - b[0]) < a[2] + b[2] && Math.abs(a[1] - b[1]) < a[3] + b[3];

/** Text around a place of the chart. @param {string} kind @param {number} x @param {number} y @param {string} words */
const centred = (kind, x, y, words) => svg("text", { class: kind, x: x.toFixed(0), y: y.toFixed(0), "text-anchor": "middle", "dominant-baseline": "middle" }, words);

export class Chart {
  /** @type {Record<string, any>} */ regions;
  /** @type {Record<string, any>} */ patterned;

  /** @param {import("./page.js").Page} page @param {[number, number]} axes indices of the parameters at first */
  constructor(page, axes) {
    this.page = page;
    this.axes = axes;
    this.rows = 0; // rows of the painted regions (0: none)
    this.painted = "";
    this.paintedAt = ""; // place of the point then
    this.written = /** @type {{text: any, room: number[]}[]} */ ([]); // words and numbers in the chart, with the room they take
    this.stripes = `stripes-${Math.random().toString(36).slice(2)}`; // unique: a document may have several pages
    const { parameters } = page.rig.data;
    this.choices = [0, 1].map((which) => {
      const select = make("select", { "aria-label": which ? "up: parameter upwards" : "across: parameter across" },
        ...parameters.map((one) => make("option", { value: one.name, textContent: inMenu(one, parameters) })));
      select.addEventListener("change", () => {
        this.put(which, select.selectedIndex);
        this.show();
        page.note();
      });
      return select;
    });
    this.canvas = svg("svg", { class: "chart", tabindex: "0", role: "application" });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.drag(event, false);
    });
    this.canvas.addEventListener("pointermove", (event) => this.canvas.hasPointerCapture(event.pointerId) && this.drag(event, true));
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => page.rest());
    this.canvas.addEventListener("keydown", (event) => this.nudge(event));
    this.key = ["stable", "undamped", "unstable", "none", "unknown"].map((name) => make("span", { className: name }, make("i", { className: name }), kindWords(name, page.rig.data)));
    this.box = make("section", { className: "map", "aria-label": "chart of stability", tabIndex: -1 }, make("h2", { textContent: "Where is it stable?" }),
      make("p", { className: "pick" }, make("label", {}, "across ", this.choices[0]), make("label", {}, "up ", this.choices[1]), make("small", { textContent: "drag the point, or use the arrow keys; solid line: edge of stability, dashed: edge of steady sliding" })),
      this.canvas, make("p", { className: "key" }, ...this.key, make("span", {}, "thin lines: ", ...(page.rig.data.phrases ? ["growth rate, 1/s"] : ["stiffness over critical k/k", make("sub", { textContent: "cr" })]))));
  }

  /** Put a parameter on an axis; if it is on the other axis, swap the two. @param {number} which @param {number} chosen */
  put(which, chosen) {
    if (chosen === this.axes[1 - which]) this.axes[1 - which] = this.axes[which];
    this.axes[which] = chosen;
  }

  drag(event, same) {
    const place = this.canvas.getBoundingClientRect(), { size } = this.page, unit = (size.left + size.width + 14) / place.width;
    const x = ((event.clientX - place.left) * unit - size.left) / size.width;
    this.page.move(this.axes, [x, 1 - ((event.clientY - place.top) * unit - size.top) / size.height], same);
  }

  nudge(event) {
    const steps = NUDGES[event.key], { rig } = this.page;
    if (!steps) return;
    event.preventDefault();
    event.stopPropagation();
    const far = event.shiftKey ? 0.05 : 0.01;
    this.page.move(this.axes, this.axes.map((i, which) => this.page.scale(i).of(rig.values[i]) + far * steps[which]), false);
  }

  /** Update the chart, if it is visible or printed. @param {boolean} [printed] */
  show(printed = false) {
    if (this.page.root.dataset.width === "narrow" && this.page.part !== "chart" && !printed) return;
    const [i, j] = this.axes, { rig, size: box, ranges } = this.page, { parameters, facts } = rig.data;
    const x = this.page.scale(i), y = this.page.scale(j);
    this.choices.forEach((select, which) => (select.selectedIndex = this.axes[which]));
    const rows = Math.round((facts.searched.some(Boolean) ? ROWS_SEARCHED : ROWS) / (this.page.sliding ? THINNED : 1));
    const others = rig.values.filter((_, n) => n !== i && n !== j).concat(i, j, ...ranges[i], ...ranges[j], box.width).join();
    const at = [x.of(rig.values[i]), y.of(rig.values[j])].map((one) => Math.min(1, Math.max(0, one))), own = [at[0] * box.width, (1 - at[1]) * box.height], hides = this.written.some(({ room }) => clash(room, [...own, POINT, POINT]));
    if (others !== this.painted || rows > this.rows || (hides && !this.page.sliding && own.join() !== this.paintedAt)) { // regions are painted anew only if other values change, more rows are wanted, or the point rests on words
      [this.painted, this.rows, this.paintedAt] = [others, rows, own.join()];
      const { paths, outline, lost, border, places } = regions((a, b) => rig.status(i, x.at(a), j, y.at(b)), rows, box.width, box.height, own);
      this.frame(i, j, x, y);
      for (const [name, path] of Object.entries(paths)) put(this.regions[name], "d", path);
      for (const [name, path] of Object.entries(this.patterned)) put(path, "d", paths[name]);
      const seen = new Set(this.page.tracks.flatMap((track) => track.map((part) => CLASSES[part.status])));
      for (const one of this.key) one.hidden = !paths[one.className] && !seen.has(one.className); // no legend for regions that are not in the chart
      put(this.outline, "d", outline);
      put(this.lost, "d", lost);
      put(this.slides, "d", paths.stable + paths.unstable + paths.undamped);
      this.written = places.map(({ name, x, y, wide }) => ({ text: centred("word", x, y, kindWords(name, this.page.rig.data)), room: [x, y, wide, HALF_LINE] }));
      this.words.replaceChildren(...this.written.map(({ text }) => text));
      this.contours(i, x, j, y, own, border);
    }
    for (const { text, room } of this.written) put(text, "visibility", clash(room, [...own, POINT, POINT]) ? "hidden" : "visible");
    putAt(this.point, { cx: box.left + own[0], cy: box.top + own[1] });
    const words = [i, j].map((n) => `${parameters[n].title} ${told(parameters[n], rig.values[n])}`);
    this.canvas.setAttribute("aria-label", `stability over ${words.join(" and ")}: ${this.page.banner.sentence.textContent}. Arrow keys move the point.`);
  }

  /** Draw contours, which are left out while a slider moves; labels stand clear of the point, of each other and of words. @param {number[]} own place of the point @param {number[][]} border points of the edges */
  contours(i, x, j, y, own, border) {
    const { size: { width, height }, rig, sliding } = this.page, { phrases, facts } = rig.data, cells = phrases ? CELLS : FINE, columns = Math.round(1.3 * cells);
    this.lines.replaceChildren();
    clearTimeout(this.finer);
    if (sliding || facts.searched.some(Boolean)) return;
    const exact = (a, b) => rig.strength(i, x.at(a), j, y.at(b));
    const grid = carried(Array.from({ length: cells + 1 }, (_, b) => Array.from({ length: columns + 1 }, (_, a) => exact(a / columns, b / cells))));
    const top = Math.ceil(Math.log10(Math.max(...grid.flat().map(Math.abs).filter(Number.isFinite)))) - 1;
    const levels = phrases ? [-1, -0.1, 0.1, 1].map((share) => share * 10 ** top) : LEVELS;
    const at = (level) => (phrases ? line(grid, level, width, height) : line(grid, level, width, height, { jump: 1, exact }));
    const drawn = levels.map((level) => {
      if (phrases) return at(level);
      const [lower, upper] = [0, UPPER].map((more) => at(level / (1 + level) + more));
      return { path: lower.path + upper.path, middles: [...lower.middles, ...upper.middles] };
    });
    const near = (points, [u, v]) => points.reduce((least, [a, b]) => Math.min(least, Math.hypot(a - u, b - v)), Math.min(APART_BY, u, v, width - u, height - v));
    const lines = drawn.map(({ path, middles }, n) => {
      const others = drawn.flatMap((one, m) => (m === n ? [] : one.middles)), text = digits(levels[n], 3), size = [0.5 * FIGURE * text.length + 2, 0.5 * LINE];
      const gaps = middles.map((one) => near(others, one)), clear = gaps.map((gap, k) => (gap > TIGHT ? Math.min(gap, near(border, middles[k])) : 0));
      return { level: levels[n], path, middles, text, size, numbers: /** @type {number[][]} */ ([]), texts: /** @type {any[]} */ ([]), rooms: clear.some((gap) => gap > TIGHT) ? clear : gaps }; // clear of edges too, if there is such a place
    });
    const add = ({ middles, rooms, numbers, texts, size, text }) => { // one more number, where it is clearest
      const free = ([u, v]) => ![...this.written.map((one) => one.room), [...own, POINT, POINT]].some((one) => clash(one, [u, v, ...size])) && numbers.every(([a, b]) => Math.hypot(a - u, b - v) >= AGAIN);
      const best = rooms.reduce((best, room, k) => (room > (rooms[best] ?? (numbers.length ? ROOMY : TIGHT)) && free(middles[k]) ? k : best), -1);
      if (best < 0) return;
      const [u, v] = middles[best];
      numbers.push(middles[best]);
      texts.push(centred("number", u, v, text));
      this.written.push({ text: texts.at(-1), room: [u, v, ...size] });
    };
    const roomy = (one) => one.rooms.filter((gap) => gap > TIGHT).length, crowded = lines.slice().sort((a, b) => roomy(a) - roomy(b));
    for (let n = 0; n < NUMBERS; n++) crowded.forEach(add); // those with few places first
    const shown = lines.filter(({ numbers }) => numbers.length), known = shown.map(({ level }) => level); // a contour without a number tells nothing
    this.lines.append(...shown.flatMap(({ path, texts }) => [svg("path", { d: path, "clip-path": `url(#${this.stripes}-clip)` }), ...texts]));
    const fine = (level, jump) => line(grid, level, width, height, { jump, exact, steep: 0, steps: FEW, bends: true }).path;
    this.refine(Array.from(this.lines.querySelectorAll("path")), (n) => (phrases ? fine(known[n], Infinity) : [0, UPPER].map((more) => fine(known[n] / (1 + known[n]) + more, 1)).join("")));
  }

  /** Draw contours anew where they run exactly, one after another, so that the page answers in between. @param {any[]} paths @param {(n: number) => string} exactly */
  refine([path, ...others], exactly, n = 0) {
    if (path) this.finer = setTimeout(() => {
      put(path, "d", exactly(n));
      this.refine(others, exactly, n + 1);
    });
  }

  /** Draw axes and labels, which depend on axes, ranges and size only. */
  frame(i, j, x, y) {
    const { size: box, ranges, rig: { data: { parameters } } } = this.page, known = [i, j, ...ranges[i], ...ranges[j], box.width].join();
    if (known === this.framed) return;
    this.framed = known;
    const inner = svg("g", { transform: `translate(${box.left} ${box.top})` });
    this.regions = Object.fromEntries(CLASSES.map((name) => [name, inner.appendChild(svg("path", { class: `region ${name}` }))]));
    const marks = { none: svg("line", { x1: 0, y1: 0, x2: 0, y2: 8 }), undamped: svg("circle", { cx: 4, cy: 4, r: 0.5 }) };
    const patterns = Object.entries(marks).map(([name, mark]) => svg("pattern", { id: `${this.stripes}-${name}`, class: "stripe", width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, mark));
    this.patterned = Object.fromEntries(Object.keys(marks).map((name) => [name, svg("path", { fill: `url(#${this.stripes}-${name})` })]));
    this.outline = svg("path", { class: "outline" });
    this.lost = svg("path", { class: "outline lost" });
    this.words = svg("g", {});
    this.lines = svg("g", { class: "contours" });
    this.slides = svg("path", {}); // contours end where sliding is not steady
    inner.append(...patterns, svg("clipPath", { id: `${this.stripes}-clip` }, this.slides), ...Object.values(this.patterned), this.lines, this.outline, this.lost, this.words);
    this.point = svg("circle", { r: 8, class: "point" });
    this.canvas.setAttribute("viewBox", `0 0 ${box.left + box.width + 14} ${box.top + box.height + 46}`);
    this.canvas.replaceChildren(inner,
      axis(box, x, ranges[i], parameters[i], parameters[i].title, false), axis(box, y, ranges[j], parameters[j], parameters[j].title, true), frame(box), this.point);
  }
}
