// The page of a rig: its parts, its values, and their changes.
import { Banner } from "./banner.js";
import { Controls } from "./controls.js";
import { Course } from "./course.js";
import { button, make, put } from "./dom.js";
import { edgesOf } from "./edges.js";
import { Facts } from "./facts.js";
import { leaving } from "./leaving.js";
import { STABLE, UNKNOWN } from "./linear.js";
import { Chart } from "./map.js";
import { presets } from "./presets.js";
import { unitFor } from "./quantities.js";
import { Rig, inside, nearestOf, rangeOf, scaleOf } from "./rig.js";
import { changes } from "./search.js";
import { all, choose, chosen, chosenIn } from "./view.js";
import { kindOf, kindWords } from "./words.js";

/** Boxes of the chart axes on a narrow and a wide page, SVG units; letters have one size on both. */
const NARROW = { left: 66, top: 8, width: 270, height: 250 }, WIDE = { left: 72, top: 10, width: 560, height: 400 };
const MIDDLE = 720, WIDE_FROM = 1280; // page widths (px) from which there are two and three columns
const OTHERS = 40; // values of the bar parameter at which eigenvalues are drawn
const SOUGHT = 1e3; // factor beyond a slider range within which it is widened to reach a change of status
const OPENED = { values: "values", chart: "chart", motion: "motion", numbers: "numbers" }; // parts of a narrow page, shown one at a time
const SAID = 4000, NAMED = 4; // SAID: ms for which a notice is shown; NAMED: most parts of a refused link that it lists
const TURNS = 4; // redraws in which every row out of view has its turn while a slider moves
const DRAWN = 1e150; // larger numbers, and those below its inverse, are on no scale

export class Page {
  /** @type {any} */ answer;
  // parts that are made after the verdict is shown
  /** @type {[number, number][]} */ home; // slider ranges of the rig of the file
  /** @type {[number, number][]} */ ranges; // present slider ranges
  /** @type {(import("./search.js").Found & {values: number[], coarse: boolean})[]} */ found = []; // changes of status for each parameter, with the values they were found for
  /** @type {{from: number, to: number, at: number, status: number}[][]} */ tracks; // track of each slider: positions, value and status of its pieces
  /** @type {Controls} */ controls;
  /** @type {Chart} */ chart;
  /** @type {Facts} */ facts;
  /** @type {Course} */ course;
  /** @type {any} */ tools;
  size = WIDE;
  guessing = false;
  wide = 0; // width of the bar, px
  turn = 0; // which rows out of view are updated while a slider moves
  part = OPENED.values; // part shown on a narrow page
  first = /** @type {Record<string, string>} */ ({}); // initial choices of the page

  /**
   * @param {HTMLElement} root @param {any} data @param {any} programs @param {() => any} library
   * @param {((values: number[]) => void) | null} [told] called with new values; then the page does not change its address
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
    this.means = make("span", { className: "tells", textContent: this.rig.data.means }); // what "stable" leaves open
    this.next = make("small", {}); // the nearest edge, on a narrow page
    root.replaceChildren(this.skips(), this.head(), this.banner.box, make("nav", { className: "tabs", "aria-label": "parts of the page" }, this.word, this.next, ...this.tabs));
    this.open(this.part);
    this.judge();
    requestAnimationFrame(() => setTimeout(() => this.furnish(library))); // let the browser show the verdict first
  }

  /** Make everything below the verdict. @param {() => any} library */
  furnish(library) {
    const { rig, root } = this, { data } = rig, values = rig.values;
    rig.values = data.parameters.map((one) => one.value);
    this.search();
    this.home = data.parameters.map((one, i) => rangeOf(one, one.value, this.found[i].edges.map(({ at }) => at)));
    this.fit(rig.values);
    const near = this.edges().filter((edge) => !edge.far && edge.at).map((edge) => edge.i);
    if (data.phrases && near.length) [rig.bar] = near; // show the parameter with the nearest edge
    const k = Math.max(0, rig.bar), across = near.find((i) => i !== k) ?? (k === 0 ? 1 % data.parameters.length : 0);
    const menu = presets(this);
    rig.values = values;
    this.fit(values);
    this.trace();
    this.controls = new Controls(this);
    this.chart = new Chart(this, [across, k]);
    this.facts = new Facts(this);
    this.course = new Course(this, library);
    root.append(make("main", {}, this.controls.box, make("div", { className: "middle" }, this.chart.box, this.course.box), this.facts.box), this.foot());
    this.tools.prepend(menu);
    this.tools.append(...leaving(this), make("button", { type: "button", textContent: "guess first", title: "hide the verdict until it is guessed, for teaching", "aria-pressed": "false", onclick: (event) => this.guess(event.currentTarget) }), button("◐", "light or dark", () => {
      const dark = getComputedStyle(root).colorScheme.includes("dark");
      root.dataset.theme = dark ? "light" : "dark";
    }));
    this.first = all(this);
    if (!this.told) choose(this, chosenIn(location.hash));
    this.redraw();
    new ResizeObserver(() => root.style.setProperty("--head", `${this.banner.box.offsetHeight + 8}px`)).observe(this.banner.box);
    new ResizeObserver(() => {
      if (!this.measure()) return;
      this.chart.show();
      this.course.draw();
    }).observe(root);
    new IntersectionObserver((all) => (root.dataset.told = String(all[all.length - 1].isIntersecting))).observe(this.banner.sentence);
    window.addEventListener("beforeprint", () => this.chart.show(true));
    window.addEventListener("hashchange", (event) => {
      const link = new URL(event.newURL).hash; // not location.hash, which may have changed since
      if (this.told || link === this.hash()) return;
      const values = this.fromAddress(link);
      choose(this, chosenIn(link));
      this.put(values);
      this.redraw();
    });
    root.dataset.ready = "yes";
  }

  /** Show a part of a narrow page. @param {string} part */
  open(part) {
    this.part = part in OPENED ? part : OPENED.values;
    this.root.dataset.part = this.part;
    this.tabs.forEach((tab, n) => put(tab, "aria-pressed", String(Object.keys(OPENED)[n] === this.part)));
    if (!this.chart) return;
    this.chart.show();
    this.note();
  }

  /** Show a notice over the page for some seconds. @param {string} words */
  say(words) {
    this.said.textContent = words;
    clearTimeout(this.unsaid);
    this.unsaid = setTimeout(() => (this.said.textContent = ""), SAID);
  }

  /** Values from the address or a link, with a notice on the parts that do not fit this rig. */
  fromAddress(link = location.hash) {
    const { values, left } = this.rig.fromHash(link), { notice } = this.banner, many = left.length - NAMED;
    if (this.differs.length) return values; // keep the notice on differences from Python
    notice.textContent = left.length ? `The link has what this rig cannot take; it is left out: ${left.slice(0, NAMED).join(", ")}${many > 0 ? `, and ${many} more` : ""}.` : "";
    return values;
  }

  /** Measure the width of the page (it may be part of a window); true if charts must be drawn anew. */
  measure() {
    const width = this.root.clientWidth, before = this.size;
    this.root.dataset.width = width < MIDDLE ? "narrow" : width < WIDE_FROM ? "middle" : "wide";
    this.size = width < 600 ? NARROW : WIDE;
    this.wide = width < MIDDLE ? width - 60 : 0.38 * Math.min(width, 1500); // width of the bar, px
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

  /** Buttons for the keyboard that lead to the parts of the page. */
  skips() {
    const to = (words, part, box) => make("button", { type: "button", textContent: `skip to the ${words}`, onclick: () => {
      if (part) this.open(part);
      box()?.focus();
    } });
    return make("nav", { className: "skip", "aria-label": "skip links" }, to("verdict", "", () => this.banner.box), to("values", "values", () => this.controls?.rows[0]?.slider),
      to("chart", "chart", () => this.chart?.canvas), to("motion", "motion", () => this.course?.box), to("edges", "numbers", () => this.facts?.box));
  }

  /** Hide the verdict until it is guessed, after each change of values, or end that. @param {any} pressed button */
  guess(pressed) {
    this.guessing = !this.guessing;
    put(pressed, "aria-pressed", String(this.guessing));
    delete this.root.dataset.guess;
    this.hide();
  }

  /** Hide all that tells the verdict while it is to be guessed; what that is stands in the style sheet. */
  hide() {
    if (!this.guessing) return;
    this.say("");
    this.open(OPENED.values);
    this.root.dataset.guess = "yes";
  }

  /** Show the verdict after a guess, and say whether it was right. @param {string} kind */
  guessed(kind) {
    delete this.root.dataset.guess;
    const now = kindOf(this.answer);
    this.say(`${kind === now ? "Right" : "Not so"}: ${this.banner.sentence.textContent}`);
  }

  foot() {
    const many = this.rig.data.checks.length;
    const words = this.differs.length ? "" : `This browser agrees with ${many} answers of Python that came with the page. `;
    return make("footer", {}, `${words}Everything is computed here; the page asks for nothing from outside. `, this.means);
  }

  scale(i) {
    return scaleOf(this.rig.data.parameters[i], ...this.ranges[i]);
  }

  /** Widen the slider range of a parameter to contain a value that can be drawn. */
  reach(i, value) {
    const [low, high] = this.ranges[i], size = Math.min(DRAWN, Math.max(1 / DRAWN, Math.abs(value)));
    if (value > 0 && (value < low || value > high)) this.ranges[i] = [Math.min(low, size / 3), Math.max(high, size * 3)];
    else if (value < 0 && value < low) this.ranges[i] = [-size * 3, high];
  }

  /** Set slider ranges for values not set by sliders: those of the rig of the file, widened to contain the values. */
  fit(values) {
    if (!this.home) return;
    this.ranges = this.home.slice();
    values.forEach((value, i) => this.reach(i, value));
  }

  /** Widen a slider range without any change of status to the nearest change outside, within `SOUGHT`. */
  seek(i) {
    const one = this.rig.data.parameters[i], [low, high] = this.ranges[i], all = this.found[i].edges.map(({ at }) => at);
    if (low < 0) {
      const [least, most] = rangeOf(one, this.rig.values[i], all);
      if (one.low === null || one.high === null) this.ranges[i] = [Math.min(low, least), Math.max(high, most)];
      return;
    }
    if ((one.low !== null && one.high !== null) || all.some((at) => at >= low && at <= high)) return; // the domain is bounded, or a change is in the range
    const above = nearestOf(all.filter((at) => at > high || (at < low && at > 0)), low > 0 ? Math.sqrt(low * high) : high), far = low > 0 ? low / SOUGHT : 0;
    if (above !== undefined && above > far && above < high * SOUGHT) this.reach(i, above);
  }

  /** Widen the range of the stiffness slider to the critical stiffness, which depends on other parameters. */
  follow() {
    const { answer, rig: { data, values, bar } } = this, i = data.phrases ? bar : data.parameters.findIndex((one) => one.name === data.stiffness);
    if (i < 0 || answer.critical === null) return;
    if (data.phrases) return this.reach(i, answer.critical);
    const { critical, share, gain, stiffness } = answer, { name } = data.parameters[i];
    if (i === data.axial) this.reach(i, critical / share);
    else if (name === "slider.stiffness") this.reach(i, critical);
    else if (gain > 0) this.reach(i, (values[i] * (critical + gain - stiffness)) / gain); // a gain acts as a stiffness
  }

  // -- changes of values

  /** Set new values, with undo. @param {number[]} values @param {boolean} [same] true if it continues the last change (one undo for both) */
  change(values, same = false) {
    if (this.rig.has(values)) return;
    if (!same) {
      this.past = [...this.past.slice(-199), this.rig.values];
      this.course?.keep();
    }
    this.future = [];
    this.rig.values = values;
    this.hide();
    this.redraw();
  }

  /** Set new values that do not come from a slider. @param {number[]} values */
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
    this.hide();
    this.fit(values);
    this.course?.keep();
    this.redraw();
  }

  with(i, value) {
    const values = this.rig.values.slice();
    values[i] = value;
    return values;
  }

  /** Set a value that was typed. */
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

  /** Set two parameters from positions (0 to 1) on their scales. @param {number[]} which @param {number[]} positions */
  move(which, positions, same) {
    const values = this.rig.values.slice();
    which.forEach((i, n) => {
      const value = this.tidy(i, this.scale(i).at(Math.min(1, Math.max(0, positions[n]))));
      if (inside(this.rig.data.parameters[i], value)) values[i] = value;
    });
    this.sliding = same;
    this.change(values, same);
  }

  /** End of a drag of a slider or chart point. */
  rest() {
    if (!this.sliding) return;
    this.sliding = false;
    this.redraw();
  }

  /** Value from a slider, rounded to four digits. */
  tidy(i, value) {
    const round = this.rounded(i, value, 4);
    return inside(this.rig.data.parameters[i], round) ? round : value;
  }

  /** Value rounded to so many digits in the unit in which it is shown. */
  rounded(i, value, many) {
    const one = this.rig.data.parameters[i], [unit] = unitFor(one, value);
    return one.whole ? Math.round(value) : Number((Number((value / unit).toPrecision(many)) * unit).toPrecision(15));
  }

  // -- results that depend on the values

  /** True for a parameter whose row must be updated now: while a slider moves, rows out of view take turns, but for that on the bar and that of the nearest edge. @param {number} i */
  due(i) {
    return !this.sliding || i % TURNS === this.turn || i === this.rig.bar || i === this.nearest || !this.controls || this.controls.inView(i);
  }

  /** Update the changes of status along every parameter; those of a parameter stay while only it changes. */
  search() {
    const { rig, sliding, ranges } = this, { values } = rig;
    this.turn = (this.turn + 1) % TURNS;
    rig.data.parameters.forEach((_, i) => {
      if (!this.due(i)) return;
      const known = this.found[i], range = ranges?.[i], moved = known && values.some((value, j) => !(i === j && sliding) && !Object.is(value, known.values[j]));
      if (!known || moved || (known.coarse && !sliding) || (range && (range[0] < known.low || range[1] > known.high))) this.found[i] = { ...changes(rig, i, range, sliding), values, coarse: sliding };
    });
  }

  /** Update the changes of status, and the tracks that show them. */
  trace() {
    this.search();
    if (!this.sliding) this.found.forEach((_, i) => this.seek(i));
    this.tracks = this.found.map((_, i) => this.track(i));
  }

  /** Pieces of a track: positions (0 to 1) and values of the ends, and status between. */
  track(i) {
    const scale = this.scale(i), [low, high] = [scale.at(0), scale.at(1)], { edges, status } = this.found[i], inner = edges.filter(({ at }) => at > low && at < high);
    const first = inner[0]?.below ?? edges.filter(({ at }) => at <= low).at(-1)?.above ?? status, at = (n) => (n < inner.length ? scale.of(inner[n].at) : 1);
    return Array.from({ length: inner.length + 1 }, (_, n) => ({ from: n ? at(n - 1) : 0, to: at(n), at: inner[n]?.at ?? high, status: n ? inner[n - 1].above : first }));
  }

  /** Nearest edges beyond the ends of a track, below and above. @param {number} i */
  beyond(i) {
    const [low, high] = this.ranges[i], at = this.found[i].edges.filter(({ below, above }) => below !== UNKNOWN && above !== UNKNOWN).map((edge) => edge.at);
    return [at.filter((x) => x < low).at(-1), at.find((x) => x > high)];
  }

  /** Nearest edge of every parameter, nearest first. */
  edges() {
    return edgesOf(this);
  }

  judge() {
    this.answer = this.rig.assess();
    this.banner.show(this.answer);
    const kind = kindOf(this.answer);
    put(this.word.parentElement ?? this.word, "data-kind", kind);
    this.word.textContent = kindWords(kind, this.rig.data);
  }

  /** Text of a link with the values and choices of the page. */
  hash() {
    return this.rig.hash(this.course ? chosen(this) : []);
  }

  /** Eigenvalues at other values of the bar parameter, over its range and at its edges, if it does not enter linearly. */
  others() {
    const { rig } = this, i = rig.bar, at = (value) => rig.set(this.with(i, value)).roots(rig.data.branch), scale = this.scale(i), many = this.sliding ? OTHERS / 4 : OTHERS;
    return { along: Array.from({ length: many }, (_, n) => at(scale.at((n + 0.5) / many))), beyond: this.tracks[i].slice(0, -1).map((part) => at(part.at)) };
  }

  /** Put the link into the address, with a delay, as browsers are slow at that. */
  note() {
    clearTimeout(this.addressed);
    if (this.told || this.sliding) return;
    this.addressed = setTimeout(() => {
      try {
        history.replaceState(null, "", this.hash() || location.pathname + location.search);
      } catch { /* a frame without an address of its own */ }
    }, 100);
  }

  /** Show another parameter on the bar. @param {number} i */
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
    const [first] = this.edges();
    this.nearest = first?.i;
    this.banner.follow(this.answer, first);
    this.means.hidden = this.answer.status !== STABLE;
    this.controls.show();
    this.chart.show();
    this.facts.show(this.answer);
    if (!this.sliding) this.facts.showEdges();
    this.course.soon();
    if (this.told && !this.sliding) this.told(this.rig.values);
    this.note();
  }
}

/** Make the page of a rig inside an element. @param {HTMLElement} root @param {any} data @param {any} programs @param {() => any} library */
export function mount(root, data, programs, library) {
  return new Page(root, data, programs, library);
}

/**
 * Make the page of a rig as a notebook widget that shares its values with Python, by name.
 * @param {any} model of anywidget @param {HTMLElement} element @param {any} data @param {any} programs @param {() => any} library
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
