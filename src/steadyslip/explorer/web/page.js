// The page: what stands on it, the values that it shows, and how they change.
import { Banner } from "./banner.js";
import { Controls } from "./controls.js";
import { Course } from "./course.js";
import { button, make, put } from "./dom.js";
import { edgesOf } from "./edges.js";
import { Facts } from "./facts.js";
import { leaving } from "./leaving.js";
import { Chart } from "./map.js";
import { unitFor } from "./quantities.js";
import { Rig, inside, nearestOf, rangeOf, scaleOf } from "./rig.js";
import { changes } from "./search.js";
import { all, choose, chosen, chosenIn } from "./view.js";
import { kindOf } from "./words.js";

/** Where the chart's axes are, on a narrow page and on a wide one: its letters stay as large as the others. */
const NARROW = { left: 58, top: 8, width: 270, height: 250 }, WIDE = { left: 66, top: 10, width: 560, height: 400 };
const MIDDLE = 720, WIDE_FROM = 1280; // widths of the page from which it has two columns and three
const OTHERS = 40; // values of the bar at which eigenvalues are drawn
const SOUGHT = 1e3; // times beyond a range in which a change is worth to be reached
const OPENED = { values: "values", chart: "chart", motion: "motion", numbers: "numbers" }; // parts of a narrow page, one of which is seen
const SAID = 4000, NAMED = 4; // ms for which a word stands; parts of a link that are named
const WORDS = { stable: "stable", unstable: "unstable", edge: "on the edge", none: "no steady sliding", unknown: "no such rig" };
const DRAWN = 1e150; // numbers beyond that, and below its inverse, lie off every scale

export class Page {
  /** @type {any} */ answer;
  // furnished once the verdict is to be seen
  /** @type {[number, number][]} */ home; // ranges of the rig of the file
  /** @type {[number, number][]} */ ranges; // those of now
  /** @type {(import("./search.js").Found & {values: number[], coarse: boolean})[]} */ found = []; // of each parameter, with what it is found for
  /** @type {{from: number, to: number, at: number, status: number}[][]} */ tracks; // position and value of each end
  /** @type {Controls} */ controls;
  /** @type {Chart} */ chart;
  /** @type {Facts} */ facts;
  /** @type {Course} */ course;
  /** @type {any} */ tools;
  size = WIDE;
  wide = 0; // of the bar, in pixels
  part = OPENED.values; // what a narrow page shows
  first = /** @type {Record<string, string>} */ ({}); // what is chosen before anybody has

  /**
   * @param {HTMLElement} root @param {any} data @param {any} programs @param {() => any} library
   * @param {((values: number[]) => void) | null} [told] whom to tell of new values; then the address is not the page's own
   */
  constructor(root, data, programs, library, told = null) {
    this.root = root;
    this.told = told;
    this.rig = new Rig(data, programs);
    this.past = /** @type {number[][]} */ ([]);
    this.future = /** @type {number[][]} */ ([]);
    this.sliding = false;
    this.differs = this.rig.differences();
    this.banner = new Banner(this, this.differs);
    if (!told) this.rig.values = this.fromAddress();
    root.classList.add("steadyslip");
    this.measure();
    this.tabs = Object.entries(OPENED).map(([part, words]) => make("button", { type: "button", textContent: words, onclick: () => this.open(part) }));
    this.word = make("b", {});
    root.replaceChildren(this.head(), this.banner.box, make("nav", { className: "tabs", "aria-label": "parts of the page" }, this.word, ...this.tabs));
    this.open(this.part);
    this.judge();
    requestAnimationFrame(() => setTimeout(() => this.furnish(library))); // the verdict is to be seen first
  }

  /** Everything below the verdict. @param {() => any} library */
  furnish(library) {
    const { rig, root } = this, { data } = rig, values = rig.values;
    rig.values = data.parameters.map((one) => one.value);
    this.search();
    this.home = data.parameters.map((one, i) => rangeOf(one, one.value, this.found[i].edges.map(({ at }) => at)));
    this.fit(rig.values);
    const near = this.edges().filter((edge) => !edge.far && edge.at).map((edge) => edge.i);
    if (data.phrases && near.length) [rig.bar] = near; // the parameter whose edge is nearest
    const k = Math.max(0, rig.bar), across = near.find((i) => i !== k) ?? (k === 0 ? 1 % data.parameters.length : 0);
    rig.values = values;
    this.fit(values);
    this.trace();
    this.controls = new Controls(this);
    this.chart = new Chart(this, [across, k]);
    this.facts = new Facts(this);
    this.course = new Course(this, library);
    root.append(make("main", {}, this.controls.box, make("div", { className: "middle" }, this.chart.box, this.course.box), this.facts.box), this.foot());
    this.tools.append(...leaving(this), button("◐", "light or dark", () => {
      const dark = getComputedStyle(root).colorScheme.includes("dark");
      root.dataset.theme = dark ? "light" : "dark";
    }));
    this.first = all(this);
    if (!this.told) choose(this, chosenIn(location.hash));
    this.redraw();
    new ResizeObserver(() => {
      if (!this.measure()) return;
      this.chart.show();
      this.course.draw();
    }).observe(root);
    window.addEventListener("hashchange", (event) => {
      const link = new URL(event.newURL).hash; // the address may have been written over since
      if (this.told || link === this.hash()) return;
      const values = this.fromAddress(link);
      choose(this, chosenIn(link));
      this.put(values);
      this.redraw();
    });
    root.dataset.ready = "yes";
  }

  /** Another part, where one is seen at a time. @param {string} part */
  open(part) {
    this.part = part in OPENED ? part : OPENED.values;
    this.root.dataset.part = this.part;
    this.tabs.forEach((tab, n) => put(tab, "aria-pressed", String(Object.keys(OPENED)[n] === this.part)));
    if (!this.chart) return;
    this.chart.show();
    this.note();
  }

  /** A word that needs no answer, over the page for some seconds. @param {string} words */
  say(words) {
    this.said.textContent = words;
    clearTimeout(this.unsaid);
    this.unsaid = setTimeout(() => (this.said.textContent = ""), SAID);
  }

  /** Values of the address, or of a link; what of it this rig cannot take is said. */
  fromAddress(link = location.hash) {
    const { values, left } = this.rig.fromHash(link), { notice } = this.banner, many = left.length - NAMED;
    if (this.differs.length) return values; // what is said of that is to stay
    notice.textContent = left.length ? `The link has what this rig cannot take; it is left out: ${left.slice(0, NAMED).join(", ")}${many > 0 ? `, and ${many} more` : ""}.` : "";
    return values;
  }

  /** How wide the page is, which need not be the window's width; true if its charts are to be drawn anew. */
  measure() {
    const width = this.root.clientWidth, before = this.size;
    this.root.dataset.width = width < MIDDLE ? "narrow" : width < WIDE_FROM ? "middle" : "wide";
    this.size = width < 600 ? NARROW : WIDE;
    this.wide = width < MIDDLE ? width - 60 : 0.38 * Math.min(width, 1500); // of the bar
    return this.size !== before;
  }

  head() {
    this.undoButton = button("↶", "undo", () => this.step(this.past, this.future));
    this.redoButton = button("↷", "redo", () => this.step(this.future, this.past));
    const { title, version, parameters } = this.rig.data;
    this.tools = make("div", { className: "tools", role: "toolbar", "aria-label": "page" }, this.undoButton, this.redoButton,
      button("reset", "back to the values of the file", () => {
        parameters.forEach((_, i) => this.controls.forget(i));
        this.put(parameters.map((one) => one.value));
        this.controls.show();
      }));
    this.said = make("p", { className: "said", role: "status" });
    return make("header", {}, this.said, make("p", { className: "brand" }, make("b", { textContent: title }), ` explored with steadyslip ${version}`), this.tools);
  }

  foot() {
    const many = this.rig.data.checks.length;
    const words = this.differs.length ? "" : `This browser agrees with ${many} answers of Python that came with the page. `;
    return make("footer", {}, `${words}Everything is computed here; the page asks for nothing from outside. The verdict is on small disturbances: a large kick may still start an oscillation.`);
  }

  scale(i) {
    return scaleOf(this.rig.data.parameters[i], ...this.ranges[i]);
  }

  /** Widen the range of a parameter to hold a value, if that can be drawn. */
  reach(i, value) {
    const [low, high] = this.ranges[i], size = Math.min(DRAWN, Math.max(1 / DRAWN, Math.abs(value)));
    if (value > 0 && (value < low || value > high)) this.ranges[i] = [Math.min(low, size / 3), Math.max(high, size * 3)];
    else if (value < 0 && value < low) this.ranges[i] = [-size * 3, high];
  }

  /** Ranges for values that no hand has set: those of the rig of the file, widened where the values lie outside. */
  fit(values) {
    if (!this.home) return;
    this.ranges = this.home.slice();
    values.forEach((value, i) => this.reach(i, value));
  }

  /** A range within which nothing changes is widened to the nearest change outside, if there is one within some decades. */
  seek(i) {
    const one = this.rig.data.parameters[i], [low, high] = this.ranges[i], all = this.found[i].edges.map(({ at }) => at);
    if ((one.low !== null && one.high !== null) || all.some((at) => at >= low && at <= high)) return; // it is all there is
    const above = nearestOf(all.filter((at) => at > high || (at < low && at > 0)), low > 0 ? Math.sqrt(low * high) : high), far = low > 0 ? low / SOUGHT : 0;
    const below = all.filter((at) => at < low && low < 0).at(-1);
    if (above !== undefined && above > far && above < high * SOUGHT) this.reach(i, above);
    else if (below !== undefined && below > low * SOUGHT) this.reach(i, below);
  }

  /** The slider of the stiffness reaches to the critical one, which other parameters move. */
  follow() {
    const { answer, rig: { data, values, bar } } = this, i = data.phrases ? bar : data.parameters.findIndex((one) => one.name === data.stiffness);
    if (i < 0 || answer.critical === null) return;
    if (data.phrases) return this.reach(i, answer.critical);
    const { critical, share, gain, stiffness } = answer, { name } = data.parameters[i];
    if (i === data.axial) this.reach(i, critical / share);
    else if (name === "slider.stiffness") this.reach(i, critical);
    else if (gain > 0) this.reach(i, (values[i] * (critical + gain - stiffness)) / gain); // the gain takes part as a spring does
  }

  // -- changes

  /** New values, to be undone. @param {number[]} values @param {boolean} [same] whether it goes on with the last change */
  change(values, same = false) {
    if (this.rig.has(values)) return;
    if (!same) {
      this.past = [...this.past.slice(-199), this.rig.values];
      this.course?.keep();
    }
    this.future = [];
    this.rig.values = values;
    this.redraw();
  }

  /** New values that no hand on a slider has set. @param {number[]} values */
  put(values) {
    if (this.rig.has(values)) return;
    this.fit(values);
    this.change(values);
  }

  step(from, to) {
    const values = from.pop();
    if (!values) return;
    to.push(this.rig.values);
    this.rig.values = values;
    this.fit(values);
    this.course?.keep();
    this.redraw();
  }

  with(i, value) {
    const values = this.rig.values.slice();
    values[i] = value;
    return values;
  }

  /** A value that was typed. */
  place(i, value) {
    this.put(this.with(i, value));
    this.redraw();
  }

  slide(i, position, continuing) {
    const value = this.tidy(i, this.scale(i).at(Math.min(1, Math.max(0, position))));
    if (!inside(this.rig.data.parameters[i], value)) return;
    const same = continuing && this.sliding;
    this.sliding = continuing;
    this.change(this.with(i, value), same);
  }

  /** Two parameters at positions of their scales. @param {number[]} which @param {number[]} positions */
  move(which, positions, same) {
    const values = this.rig.values.slice();
    which.forEach((i, n) => {
      const value = this.tidy(i, this.scale(i).at(Math.min(1, Math.max(0, positions[n]))));
      if (inside(this.rig.data.parameters[i], value)) values[i] = value;
    });
    this.sliding = same;
    this.change(values, same);
  }

  /** A hand has let go. */
  rest() {
    if (!this.sliding) return;
    this.sliding = false;
    this.redraw();
  }

  /** Four digits are enough for what a hand sets. */
  tidy(i, value) {
    const round = this.rounded(i, value, 4);
    return inside(this.rig.data.parameters[i], round) ? round : value;
  }

  /** A value of so many digits in the unit in which it is shown. */
  rounded(i, value, many) {
    const one = this.rig.data.parameters[i], [unit] = unitFor(one, value);
    return one.whole ? Math.round(value) : Number((Number((value / unit).toPrecision(many)) * unit).toPrecision(15));
  }

  // -- what follows from the values

  /** All edges of every parameter for the values of now; those of one parameter stay while it alone varies. */
  search() {
    const { rig, sliding, ranges } = this, { values } = rig;
    rig.data.parameters.forEach((_, i) => {
      const known = this.found[i], range = ranges?.[i], moved = known && values.some((value, j) => !(i === j && sliding) && !Object.is(value, known.values[j]));
      if (!known || moved || (known.coarse && !sliding) || (range && (range[0] < known.low || range[1] > known.high))) this.found[i] = { ...changes(rig, i, range, sliding), values, coarse: sliding };
    });
  }

  /** Edges, and tracks that show them. */
  trace() {
    this.search();
    if (!this.sliding) this.found.forEach((_, i) => this.seek(i));
    this.tracks = this.found.map((_, i) => this.track(i));
  }

  /** Positions between 0 and 1 where a track changes, and values, with what is between. */
  track(i) {
    const scale = this.scale(i), [low, high] = [scale.at(0), scale.at(1)], { edges, status } = this.found[i], inner = edges.filter(({ at }) => at > low && at < high);
    const first = inner[0]?.below ?? edges.filter(({ at }) => at <= low).at(-1)?.above ?? status, at = (n) => (n < inner.length ? scale.of(inner[n].at) : 1);
    return Array.from({ length: inner.length + 1 }, (_, n) => ({ from: n ? at(n - 1) : 0, to: at(n), at: inner[n]?.at ?? high, status: n ? inner[n - 1].above : first }));
  }

  /** The nearest change of every parameter inside its range, the most urgent first. */
  edges() {
    return edgesOf(this);
  }

  judge() {
    this.answer = this.rig.assess();
    this.banner.show(this.answer);
    const kind = kindOf(this.answer);
    put(this.word.parentElement ?? this.word, "data-kind", kind);
    this.word.textContent = WORDS[kind];
  }

  /** Values, and what is chosen, as a link has them. */
  hash() {
    return this.rig.hash(this.course ? chosen(this) : []);
  }

  /** Eigenvalues at other values of what the bar shows, where they follow from no formula: over its range, and at its edges. */
  others() {
    const { rig } = this, i = rig.bar, at = (value) => rig.set(this.with(i, value)).roots(rig.data.branch), scale = this.scale(i), many = this.sliding ? OTHERS / 4 : OTHERS;
    return { along: Array.from({ length: many }, (_, n) => at(scale.at((n + 0.5) / many))), beyond: this.tracks[i].slice(0, -1).map((part) => at(part.at)) };
  }

  /** The same in the address, soon: browsers take long over it. */
  note() {
    clearTimeout(this.addressed);
    if (this.told || this.sliding) return;
    this.addressed = setTimeout(() => {
      try {
        history.replaceState(null, "", this.hash() || location.pathname + location.search);
      } catch { /* a frame without an address of its own */ }
    }, 100);
  }

  /** Another parameter on the bar. @param {number} i */
  tell(i) {
    this.rig.bar = i;
    this.chart.put(1, i);
    this.redraw();
  }

  redraw() {
    this.judge();
    if (this.home && !this.sliding) this.follow();
    this.undoButton.disabled = !this.past.length;
    this.redoButton.disabled = !this.future.length;
    if (!this.controls) return;
    this.trace();
    this.banner.follow(this.answer, this.edges()[0]);
    this.controls.show();
    this.chart.show();
    this.facts.show(this.answer);
    if (!this.sliding) this.facts.showEdges();
    this.course.soon();
    if (this.told && !this.sliding) this.told(this.rig.values);
    this.note();
  }
}

/** Fill an element with the page of one rig. @param {HTMLElement} root @param {any} data @param {any} programs @param {() => any} library */
export function mount(root, data, programs, library) {
  return new Page(root, data, programs, library);
}

/**
 * The same as a widget of a notebook: values go to Python and come from there, by name.
 * @param {any} model anywidget's @param {HTMLElement} element @param {any} data @param {any} programs @param {() => any} library
 */
export function render(model, element, data, programs, library) {
  const root = element.appendChild(make("div", {})), names = data.parameters.map((one) => one.name);
  const page = new Page(root, data, programs, library, (values) => {
    const now = Object.fromEntries(names.map((name, i) => [name, values[i]])), before = model.get("values");
    if (names.every((name) => Object.is(now[name], before[name]))) return;
    model.set("values", now);
    model.save_changes();
  });
  const take = () => {
    const given = model.get("values"), { values } = page.rig;
    page.put(names.map((name, i) => (inside(data.parameters[i], given[name]) ? given[name] : values[i])));
  };
  take();
  model.on("change:values", take);
}
