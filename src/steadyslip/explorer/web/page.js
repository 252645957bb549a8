// The page: verdict, sliders with painted tracks, chart, eigenvalues, edges; all of it from one rig and its answers.
import { CLASSES, axis, regions, strip, svg } from "./chart.js";
import { ABSENT, STABLE, UNKNOWN } from "./linear.js";
import { DISTURBANCES, Motion } from "./motion.js";
import { digits, display, parse, shown } from "./quantities.js";
import { Rig, inside, rangeOf, scaleOf } from "./rig.js";

const STEPS = 1000;
/** Where the chart's axes are, on a narrow page and on a wide one: its letters stay as large as the others. */
const NARROW = { left: 58, top: 8, width: 270, height: 250 }, WIDE = { left: 66, top: 10, width: 560, height: 400 };

/** An element with properties and children. @param {string} name @param {Record<string, any>} properties @returns {any} */
function make(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in made && key !== "style") /** @type {any} */ (made)[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

class Page {
  /** @param {HTMLElement} root @param {any} data @param {any} programs @param {any} machine @param {any} driver */
  constructor(root, data, programs, machine, driver) {
    this.root = root;
    this.rig = new Rig(data, programs);
    this.mover = machine && new Motion(machine, data.motion, driver);
    this.past = /** @type {number[][]} */ ([]);
    this.future = /** @type {number[][]} */ ([]);
    this.stripes = `stripes-${Math.random().toString(36).slice(2)}`; // several pages may share a document
    this.differs = this.rig.differences();
    this.ranges = data.parameters.map((_, i) => rangeOf(this.rig, i));
    const k = Math.max(0, data.parameters.findIndex((one) => one.name === data.stiffness));
    this.axes = [this.urgent(k), k];
    this.rig.values = this.rig.fromHash(location.hash);
    this.box = root.clientWidth < 600 ? NARROW : WIDE;
    root.classList.add("steadyslip");
    root.replaceChildren(this.head(), this.verdict(), make("main", {}, this.controls(), make("div", { className: "middle" }, this.chart(), this.motion()), this.facts()), this.foot());
    this.redraw();
    new ResizeObserver(() => {
      const box = root.clientWidth < 600 ? NARROW : WIDE;
      if (box === this.box) return;
      this.box = box;
      this.painted = "";
      this.showChart();
      this.showMotion();
    }).observe(root);
    window.addEventListener("hashchange", () => {
      if (location.hash !== this.rig.hash()) this.change(this.rig.fromHash(location.hash));
    });
  }

  /** The parameter, other than one, whose edge is nearest: the first that a user will want to see. */
  urgent(besides) {
    this.tracks = this.rig.data.parameters.map((_, i) => this.track(i));
    const edges = this.edges().filter((edge) => edge.i !== besides);
    return edges.length ? edges[0].i : besides === 0 ? 1 : 0;
  }

  scale(i) {
    return scaleOf(this.rig.data.parameters[i], ...this.ranges[i]);
  }

  // -- parts

  head() {
    const button = (text, label, action) => make("button", { type: "button", textContent: text, title: label, "aria-label": label, onclick: action });
    this.undoButton = button("↶", "undo", () => this.step(this.past, this.future));
    this.redoButton = button("↷", "redo", () => this.step(this.future, this.past));
    const { title, version } = this.rig.data;
    return make("header", {}, make("p", { className: "brand" }, make("b", { textContent: title }), ` steadyslip ${version}`),
      make("div", { className: "tools", role: "toolbar", "aria-label": "page" }, this.undoButton, this.redoButton,
        button("reset", "back to the rig of the file", () => this.change(this.rig.data.parameters.map((one) => one.value))),
        button("link", "copy a link to these values", () => this.link()),
        button("TOML", "save as a rig file", () => this.save("rig.toml", "text/plain", this.rig.toml())),
        button("SVG", "save the chart as a picture", () => this.save("chart.svg", "image/svg+xml", this.picture())),
        button("CSV", "save values and edges as a table", () => this.save("edges.csv", "text/csv", this.table())),
        button("◐", "light or dark", () => {
          const dark = getComputedStyle(this.root).colorScheme.includes("dark");
          this.root.dataset.theme = dark ? "light" : "dark";
        })));
  }

  verdict() {
    this.sentence = make("h1", {});
    this.reason = make("p", {});
    this.bar = make("div", { className: "bar", role: "img" });
    this.notice = make("p", { className: "notice", role: "status" });
    if (this.differs.length) this.notice.textContent = `This browser computes otherwise than Python did (${this.differs.slice(0, 3).join("; ")}): do not rely on this page.`;
    this.banner = make("section", { className: "verdict", "aria-label": "verdict" }, make("div", { "aria-live": "polite" }, this.sentence, this.reason), this.bar, this.notice);
    return this.banner;
  }

  controls() {
    const section = make("section", { className: "controls", "aria-label": "parameters" });
    let group = "";
    this.rows = this.rig.data.parameters.map((one, i) => {
      const first = one.name.split(".")[0];
      if (first !== group) section.append(make("h2", { textContent: first }));
      group = first;
      const row = this.row(one, i);
      section.append(row.box);
      return row;
    });
    return section;
  }

  row(one, i) {
    const label = `${one.name}: ${one.doc}`;
    const slider = make("input", { type: "range", min: "0", max: String(STEPS), step: "any", "aria-label": label });
    const text = make("input", { type: "text", "aria-label": `${label}, value with unit`, spellcheck: false, autocomplete: "off" });
    const fault = make("span", { className: "fault", role: "alert" });
    slider.addEventListener("input", () => this.slide(i, Number(slider.value) / STEPS, true));
    slider.addEventListener("change", () => (this.sliding = false));
    slider.addEventListener("keydown", (event) => this.key(event, i, slider));
    text.addEventListener("change", () => this.typed(i, text.value, fault));
    const name = make("span", { className: "name" }, make("b", { textContent: one.label.replace(/_/g, "_\u200b") }), " ", make("small", { textContent: one.doc }));
    return { box: make("div", { className: "row" }, name, text, slider, fault), slider, text, fault, name };
  }

  chart() {
    this.choices = [0, 1].map((which) => {
      const select = make("select", { "aria-label": which ? "parameter upwards" : "parameter across" },
        ...this.rig.data.parameters.map((one, i) => make("option", { value: String(i), textContent: one.name })));
      select.addEventListener("change", () => {
        const chosen = Number(select.value);
        if (chosen === this.axes[1 - which]) this.axes[1 - which] = this.axes[which];
        this.axes[which] = chosen;
        this.redraw();
      });
      return select;
    });
    this.canvas = svg("svg", { class: "chart", tabindex: "0", role: "application" });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.drag(event, false);
    });
    this.canvas.addEventListener("pointermove", (event) => this.canvas.hasPointerCapture(event.pointerId) && this.drag(event, true));
    this.canvas.addEventListener("pointerup", () => (this.sliding = false));
    this.canvas.addEventListener("keydown", (event) => this.nudge(event));
    const key = make("p", { className: "key" }, ...[["stable", "stable"], ["unstable", "unstable"], ["none", "no steady sliding"], ["unknown", "no rig"]]
      .map(([name, words]) => make("span", {}, make("i", { className: name }), words)));
    return make("section", { className: "map", "aria-label": "chart of stability" },
      make("h2", { textContent: "Where is it stable?" }),
      make("p", { className: "pick" }, make("label", {}, "across ", this.choices[0]), make("label", {}, "up ", this.choices[1]), make("small", { textContent: "drag the point, or use the arrow keys" })),
      this.canvas, key);
  }

  facts() {
    this.steady = make("dl", {});
    this.eigenvalues = make("tbody", {});
    this.near = make("ol", { className: "edges" });
    const head = make("thead", {}, make("tr", {}, ...["rate", "oscillation", "a disturbance"].map((text) => make("th", { textContent: text, scope: "col" }))));
    return make("section", { className: "facts", "aria-label": "details" },
      make("h2", { textContent: "Steady sliding" }), this.steady,
      make("h2", { textContent: "Eigenvalues" }), make("table", {}, head, this.eigenvalues),
      make("h2", { textContent: "Nearest edges" }), make("p", { className: "hint", textContent: "one parameter changed, the others as they are; press to go there" }), this.near);
  }

  motion() {
    const section = make("section", { className: "motion", "aria-label": "motion" }, make("h2", { textContent: "What does it do?" }));
    this.told = make("p", { className: "told", role: "status" });
    this.strips = svg("svg", { class: "chart strips", role: "img" });
    if (!this.mover) {
      section.append(make("p", { className: "told", textContent: `No motion on this page: ${this.rig.data.still}.` }));
      return section;
    }
    this.disturbance = make("select", { "aria-label": "disturbance" }, ...Object.entries(DISTURBANCES).map(([value, textContent]) => make("option", { value, textContent })));
    this.size = make("input", { type: "text", "aria-label": "size of the disturbance", size: 9 });
    this.length = make("input", { type: "text", "aria-label": "length of the run", size: 9, placeholder: "by itself" });
    this.halt = make("button", { type: "button", textContent: "stop", disabled: true, onclick: () => this.stop() });
    this.disturbance.addEventListener("change", () => {
      this.size.value = "";
      this.moveSoon();
    });
    for (const field of [this.size, this.length]) field.addEventListener("change", () => this.moveSoon());
    section.append(make("p", { className: "pick" }, make("label", {}, "after a ", this.disturbance), make("label", {}, "of ", this.size), make("label", {}, "for ", this.length), this.halt), this.told, this.strips);
    return section;
  }

  foot() {
    const many = this.rig.data.checks.length;
    const words = this.differs.length ? "" : `This browser agrees with ${many} answers of Python that came with the page. `;
    return make("footer", {}, `${words}Everything is computed here; the page asks for nothing from outside. The verdict is on small disturbances: a large kick may still start an oscillation.`);
  }

  // -- changes

  /** New values, to be undone. @param {number[]} values @param {boolean} [same] whether it goes on with the last change */
  change(values, same = false) {
    if (values.every((value, i) => Object.is(value, this.rig.values[i]))) return;
    if (!same) this.past = [...this.past.slice(-199), this.rig.values];
    this.future = [];
    this.rig.values = values;
    this.redraw();
  }

  step(from, to) {
    const values = from.pop();
    if (!values) return;
    to.push(this.rig.values);
    this.rig.values = values;
    this.redraw();
  }

  with(i, value) {
    const values = this.rig.values.slice();
    values[i] = value;
    return values;
  }

  slide(i, position, continuing) {
    const value = this.tidy(i, this.scale(i).at(Math.min(1, Math.max(0, position))));
    if (!inside(this.rig.data.parameters[i], value)) return;
    this.change(this.with(i, value), continuing && this.sliding);
    this.sliding = continuing;
  }

  /** Four digits are enough for what a hand sets. */
  tidy(i, value) {
    const one = this.rig.data.parameters[i], [factor] = display(value * one.factor, one.unit);
    const unit = factor / one.factor, round = one.whole ? Math.round(value) : Number((value / unit).toPrecision(4)) * unit;
    return inside(one, round) ? Number(round.toPrecision(15)) : value;
  }

  key(event, i, slider) {
    const steps = { ArrowRight: 0.005, ArrowUp: 0.005, ArrowLeft: -0.005, ArrowDown: -0.005, PageUp: 0.05, PageDown: -0.05 };
    const step = steps[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    this.slide(i, Number(slider.value) / STEPS + step, false);
  }

  typed(i, text, fault) {
    const one = this.rig.data.parameters[i];
    try {
      const [, unit] = display(this.rig.values[i] * one.factor, one.unit);
      const value = parse(text, one.unit, unit || "1") / one.factor;
      if (!inside(one, value)) throw new Error(`allowed: ${one.allowed}`);
      fault.textContent = "";
      const [low, high] = this.ranges[i];
      if (value !== 0 && (value < low || value > high)) this.ranges[i] = [Math.min(low, value > 0 ? value / 3 : value * 3), Math.max(high, value * 3)];
      this.change(this.with(i, value));
      this.redraw();
    } catch (error) {
      fault.textContent = error instanceof Error ? error.message : String(error);
    }
  }

  drag(event, same) {
    const place = this.canvas.getBoundingClientRect(), box = this.box, unit = (box.left + box.width + 14) / place.width;
    const x = ((event.clientX - place.left) * unit - box.left) / box.width;
    const y = 1 - ((event.clientY - place.top) * unit - box.top) / box.height;
    this.move(x, y, same);
  }

  move(x, y, same) {
    let values = this.rig.values.slice();
    for (const [which, position] of [[0, x], [1, y]]) {
      const i = this.axes[which], value = this.tidy(i, this.scale(i).at(Math.min(1, Math.max(0, position))));
      if (inside(this.rig.data.parameters[i], value)) values[i] = value;
    }
    this.change(values, same);
  }

  nudge(event) {
    const steps = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!steps) return;
    event.preventDefault();
    event.stopPropagation();
    const size = event.shiftKey ? 0.05 : 0.01, at = this.axes.map((i) => this.scale(i).of(this.rig.values[i]));
    this.move(at[0] + size * steps[0], at[1] + size * steps[1], false);
  }

  // -- what follows from the values

  /** Positions between 0 and 1 where a track changes, with what is between. */
  track(i) {
    const scale = this.scale(i), parts = [], count = 60;
    let before = this.rig.status(i, scale.at(0)), from = 0;
    for (let n = 1; n <= count; n++) {
      const next = this.rig.status(i, scale.at(n / count));
      if (next === before) continue;
      const [low, high] = this.rig.narrowed(i, scale, (n - 1) / count, n / count);
      parts.push({ from, to: high, status: before, below: low });
      [from, before] = [high, next];
    }
    parts.push({ from, to: 1, status: before, below: 1 });
    return parts;
  }

  /** The nearest change of every parameter inside its range, the most urgent first. */
  edges() {
    const found = [];
    this.rig.data.parameters.forEach((one, i) => {
      const scale = this.scale(i), value = this.rig.values[i];
      const parts = this.tracks[i];
      let best = null;
      parts.slice(0, -1).forEach((part, n) => {
        const at = scale.at(part.to), other = parts[n + 1].status, away = at > value;
        const beyond = away ? other : part.status, distance = one.unit === "rad" ? Math.abs(at - value) : Math.abs(at - value) / (Math.abs(value) || 1e300);
        const landing = scale.at(Math.min(1, Math.max(0, part.to + (away ? 1e-4 : -1e-4))));
        if (best === null || distance < best.distance || (!value && at < best.at)) best = { i, at, distance: value ? distance : 1e6, beyond, landing };
      });
      if (best) found.push(best);
    });
    return found.sort((a, b) => a.distance - b.distance);
  }

  redraw() {
    const answer = (this.answer = this.rig.assess());
    this.tracks = this.rig.data.parameters.map((_, i) => this.track(i));
    this.showVerdict(answer);
    this.rig.data.parameters.forEach((one, i) => this.showRow(one, i));
    this.showChart();
    this.showFacts(answer);
    this.moveSoon();
    this.undoButton.disabled = !this.past.length;
    this.redoButton.disabled = !this.future.length;
    const hash = this.rig.hash();
    try {
      if (!this.sliding) history.replaceState(null, "", hash || location.pathname + location.search);
    } catch { /* a frame without an address of its own */ }
  }

  quantity(value, unit) {
    const { area } = this.rig.data;
    if (area !== null && unit === "Pa/m") return shown(value * area, "N/m");
    return area !== null && unit === "Pa" ? shown(value * area, "N") : shown(value, unit);
  }

  showVerdict(answer) {
    const drive = this.rig.values[this.rig.data.parameters.findIndex((one) => one.name === this.rig.data.speed)];
    const speed = shown(drive, "m/s");
    const kind = answer.status === ABSENT ? "none" : answer.status === UNKNOWN ? "unknown" : answer.onEdge ? "edge" : answer.status === STABLE ? "stable" : "unstable";
    const words = { none: `No steady sliding at ${speed}`, unknown: "Numbers outside what a rig can have", edge: `On the edge of stability at ${speed}`,
      stable: `Stable: steady sliding at ${speed}`, unstable: `Unstable: steady sliding at ${speed}` };
    this.banner.dataset.kind = kind;
    this.sentence.textContent = words[kind];
    this.reason.textContent = this.why(answer);
    this.showBar(answer);
  }

  why(answer) {
    if (answer.status === ABSENT) {
      if (answer.slope >= 1) return `Lock-up: the pull raises friction by more than itself (1 − μ dσ/dτ is ${digits(1 - answer.slope)}, must be above 0).`;
      return answer.load <= 0 ? "Lift-off: the motion takes away more normal stress than the contact has." : "No positive normal stress satisfies the contact law at the steady shear stress.";
    }
    if (answer.status === UNKNOWN) return "A number leaves its range, or breaks a condition that several obey together.";
    if (answer.illPosed) return "The equations are ill-posed here: the model misses an inertia or a direct effect that matters.";
    const { critical, gain, share } = answer;
    if (critical === null) return answer.intervals.length ? "Stable at every stiffness." : "No stiffness makes this sliding stable.";
    const total = answer.stiffness + gain, edge = critical + gain, what = gain ? "Stiffness and gain together, " : "The stiffness ";
    const alone = answer.intervals.length === 1 && (answer.side === "above" ? answer.intervals[0].high === Infinity : answer.intervals[0].low === 0);
    const period = answer.frequency ? `; there it oscillates with period ${shown((2 * Math.PI) / answer.frequency, "s")}` : "";
    const along = this.rig.data.axial >= 0 ? ` (${this.quantity(edge / share, "Pa/m")} along the axis)` : "";
    const tail = alone ? `, ${answer.side} which sliding is stable${period}.` : `, the nearest edge of what is stable${period}.`;
    return `${what}${this.quantity(total, "Pa/m")}${gain ? ", are" : " is"} ${digits(total / edge, 3)} times the critical ${this.quantity(edge, "Pa/m")}${along}${tail}`;
  }

  /** The stable stiffnesses, controller's gain included, on a logarithmic bar, with the rig's own. */
  showBar(answer) {
    const { gain } = answer, own = answer.stiffness + gain; // a controller's gain counts as the sentence counts it
    const intervals = answer.intervals.map(({ low, high }) => ({ low: low + gain, high: high + gain }));
    const ends = answer.intervals.flatMap(({ low, high }) => [low, high]).filter((k) => k > 0 && Number.isFinite(k)).map((k) => k + gain);
    const marks = [...ends, own].filter((k) => k > 0);
    if (!marks.length || answer.status === ABSENT) {
      this.bar.replaceChildren();
      this.bar.setAttribute("aria-label", "no stiffness is stable");
      return;
    }
    const low = Math.log(Math.min(...marks) / 10), high = Math.log(Math.max(...marks) * 10);
    const x = (k) => 100 * Math.min(1, Math.max(0, k > 0 ? (Math.log(k) - low) / (high - low) : 0));
    const parts = intervals.map((one) => svg("rect", { class: "stable", x: x(one.low), width: x(one.high) - x(one.low), y: 0, height: 10 }));
    const drawing = svg("svg", { viewBox: "0 0 100 10", preserveAspectRatio: "none" }, svg("rect", { class: "unstable", x: 0, y: 0, width: 100, height: 10 }), ...parts);
    const at = make("i", { className: "own" });
    at.style.left = `${x(own)}%`;
    const labels = ends.map((k) => {
      const text = make("span", { textContent: this.quantity(k, "Pa/m") });
      text.style.left = `${Math.min(88, Math.max(12, x(k)))}%`;
      return text;
    });
    this.bar.replaceChildren(drawing, at, ...labels);
    const words = intervals.map(({ low: a, high: b }) => (b === Infinity ? `above ${this.quantity(a, "Pa/m")}` : `${this.quantity(a, "Pa/m")} to ${this.quantity(b, "Pa/m")}`));
    this.bar.setAttribute("aria-label", `stable stiffness: ${words.join(", or ") || "none"}`);
  }

  showRow(one, i) {
    const { slider, text, fault, name } = this.rows[i], value = this.rig.values[i], scale = this.scale(i);
    const [factor, unit] = display(value * one.factor, one.unit);
    slider.value = String(STEPS * scale.of(value));
    slider.setAttribute("aria-valuetext", shown(value * one.factor, one.unit));
    if (document.activeElement !== text || !fault.textContent) {
      text.value = `${Number(((value * one.factor) / factor).toPrecision(6))} ${unit.replace("^2", "²")}`.trim();
      fault.textContent = "";
    }
    name.classList.toggle("changed", !Object.is(value, one.value));
    const stops = this.tracks[i].flatMap((part) => [part.from, part.to].map((at) => `var(--${CLASSES[part.status]}) ${(100 * at).toFixed(2)}%`));
    slider.style.setProperty("--track", `linear-gradient(to right, ${stops.join(", ")})`);
  }

  showChart() {
    const [i, j] = this.axes, x = this.scale(i), y = this.scale(j), { parameters } = this.rig.data, box = this.box;
    this.choices.forEach((select, which) => (select.value = String(this.axes[which])));
    const others = this.rig.values.filter((_, n) => n !== i && n !== j).concat(i, j, ...this.ranges[i], ...this.ranges[j]).join();
    if (others !== this.painted) { // the point alone may move: then the regions stay
      this.painted = others;
      const rows = this.sliding || !this.rig.data.facts.affine ? 24 : 60;
      const { paths, outline } = regions((a, b) => this.rig.status(i, x.at(a), j, y.at(b)), rows, box.width, box.height);
      const inner = svg("g", { transform: `translate(${box.left} ${box.top})` });
      for (const [name, path] of Object.entries(paths)) inner.append(svg("path", { class: `region ${name}`, d: path }));
      const stripes = svg("pattern", { id: this.stripes, width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, svg("line", { x1: 0, y1: 0, x2: 0, y2: 8, class: "stripe" }));
      inner.append(stripes, svg("path", { d: paths.none, fill: `url(#${this.stripes})` }), svg("path", { class: "outline", d: outline }));
      this.point = svg("circle", { r: 8, class: "point" });
      this.canvas.setAttribute("viewBox", `0 0 ${box.left + box.width + 14} ${box.top + box.height + 46}`);
      this.canvas.replaceChildren(inner,
        axis(box, x, this.ranges[i], parameters[i].factor, parameters[i].unit, parameters[i].name, false),
        axis(box, y, this.ranges[j], parameters[j].factor, parameters[j].unit, parameters[j].name, true), this.point);
    }
    const at = [x.of(this.rig.values[i]), y.of(this.rig.values[j])].map((one) => Math.min(1, Math.max(0, one)));
    this.point.setAttribute("cx", String(box.left + at[0] * box.width));
    this.point.setAttribute("cy", String(box.top + (1 - at[1]) * box.height));
    const words = [i, j].map((n) => `${parameters[n].name} ${shown(this.rig.values[n] * parameters[n].factor, parameters[n].unit)}`);
    this.canvas.setAttribute("aria-label", `stability over ${words.join(" and ")}: ${this.sentence.textContent}. Arrow keys move the point.`);
  }

  showFacts(answer) {
    const facts = [["normal stress", answer.sigma, "Pa"], ...this.rig.data.facts.observed.map(([name, unit]) => [name.replace(/_/g, " "), answer.observed[name], unit])];
    const shownFacts = answer.status === ABSENT || answer.status === UNKNOWN ? [] : facts;
    this.steady.replaceChildren(...shownFacts.flatMap(([name, value, unit]) => [make("dt", { textContent: this.rig.data.area && unit === "Pa" ? name.replace("stress", "force") : name }), make("dd", { textContent: this.quantity(value, unit) })]));
    this.eigenvalues.replaceChildren(...answer.eigenvalues.filter((s) => s.im >= 0).map((s) => {
      const time = shown(Math.LN2 / Math.abs(s.re), "s");
      const cells = [`${digits(s.re)} 1/s`, s.im > 0 ? `period ${shown((2 * Math.PI) / s.im, "s")}` : "none", s.re > 0 ? `doubles in ${time}` : `halves in ${time}`];
      return make("tr", { className: s.re > 0 ? "grows" : "" }, ...cells.map((textContent) => make("td", { textContent })));
    }));
    if (this.sliding) return;
    const becomes = { [ABSENT]: "no steady sliding", [STABLE]: "becomes stable", [UNKNOWN]: "no rig" };
    this.near.replaceChildren(...this.edges().map((edge) => {
      const one = this.rig.data.parameters[edge.i], go = make("button", { type: "button", textContent: `${one.name} → ${shown(edge.at * one.factor, one.unit)}` });
      go.addEventListener("click", () => {
        if (inside(one, edge.landing)) this.change(this.with(edge.i, edge.landing));
      });
      return make("li", {}, go, ` ${becomes[edge.beyond] ?? "unstable"}`);
    }));
  }

  // -- motion

  /** Move the rig once the page is drawn and values rest. */
  moveSoon() {
    if (!this.mover) return;
    this.token = {};
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.move_(this.token), this.sliding ? 150 : 30);
  }

  async move_(token) {
    const refused = this.refusal();
    this.course = null;
    if (refused) {
      this.told.textContent = `No motion: ${refused}.`;
      this.strips.replaceChildren();
      return;
    }
    try {
      const { size, at, until } = this.asked();
      this.halt.disabled = false;
      this.told.textContent = "moving …";
      const found = await this.mover.run(this.disturbance.value, size, at, until, () => this.token !== token);
      if (found === null) return; // stopped, or another run has begun
      this.course = { ...found, until: found.status === "done" ? until : found.end };
      this.told.textContent = this.words(found);
      this.showMotion();
    } catch (error) {
      this.told.textContent = error instanceof Error ? error.message : String(error);
    }
    this.halt.disabled = true;
  }

  stop() {
    this.token = {};
    this.halt.disabled = true;
    this.told.textContent = "stopped";
  }

  refusal() {
    const { answer, mover } = this, { motion, parameters, facts } = this.rig.data;
    const own = (name) => this.rig.values[parameters.findIndex((one) => one.name === name)];
    if (answer.status === ABSENT || answer.status === UNKNOWN) return "there is no steady sliding to start from";
    const added = motion.missing.find((name) => own(name) > 0);
    if (added) return `the rig of the file has no ${added}; write it there, and make the page anew`;
    const model = Array.from(this.rig.set(this.rig.values).R);
    mover.set(motion.parameters.map((name) => model[facts.parameters.indexOf(name)]), answer.sigma);
    return mover.refusal(this.disturbance.value);
  }

  /** Size, begin and length as they stand in the fields, or what shows most. */
  asked() {
    const { eigenvalues, sigma } = this.answer, lead = eigenvalues.find((s) => s.im > 0) ?? eigenvalues[0], kind = this.disturbance.value;
    const scale = Math.abs(lead.im > 0 ? (2 * Math.PI) / lead.im : 5 / (lead.re || 1)), { area } = this.rig.data;
    const until = this.length.value ? parse(this.length.value, "s", "s") : 12 * scale, unit = { velocity: "1", push: "m", normal: area === null ? "Pa" : "N" }[kind];
    const usual = { velocity: 2, push: this.mover.scales.x, normal: 0.05 * sigma * (area ?? 1) }[kind];
    const size = this.size.value ? parse(this.size.value.replace(/^×\s*/, ""), unit, unit) : usual;
    if (!(until > 0)) throw new Error("the length of a run is above 0 s");
    if (kind === "velocity" && !(size > 0)) throw new Error("the velocity is multiplied by a number above 0");
    this.size.placeholder = kind === "velocity" ? "× 2" : shown(usual, unit, 3);
    this.length.placeholder = shown(12 * scale, "s", 3);
    return { size: kind === "normal" ? size / (area ?? 1) : size, at: until / 20, until };
  }

  words({ events, status, end, v }) {
    if (status === "blow-up") return `It runs away at ${shown(end, "s")}: neither mass nor damping limits the velocity.`;
    const ended = status === "done" ? "" : ` It ends at ${shown(end, "s")}: ${status}.`;
    if (!events.length) return `No slip event; velocity ${shown(v.reduce((a, b) => Math.min(a, b)), "m/s", 3)} to ${shown(v.reduce((a, b) => Math.max(a, b)), "m/s", 3)}.${ended}`;
    const last = events[events.length - 1], before = events[events.length - 2];
    const every = before ? `, the last two ${shown(last.begin - before.begin, "s", 3)} apart` : "";
    return `${events.length} slip event${events.length > 1 ? "s" : ""}${every}; the last: peak ${shown(last.peak, "m/s", 3)}, stress drop ${this.quantity(last.drop, "Pa")}.${ended}`;
  }

  showMotion() {
    if (!this.course) return;
    const { until } = this.course, most = 1e6 * this.mover.drive, fast = this.course.status === "blow-up" ? this.course.v.findIndex((one) => one > most) : -1;
    const [times, v, tau, sigma] = [this.course.times, this.course.v, this.course.tau, this.course.sigma].map((all) => (fast < 0 ? all : all.subarray(0, fast)));
    const { left, width } = this.box, { area } = this.rig.data, high = 105;
    const friction = tau.map((one, i) => one / sigma[i]), spread = sigma.reduce((a, b) => Math.max(a, b)) / sigma.reduce((a, b) => Math.min(a, b)) - 1;
    const series = [[v, "m/s", "velocity"], [friction, "1", "friction"]];
    if (spread > 1e-6) series.push([sigma.map((one) => one * (area ?? 1)), area === null ? "Pa" : "N", area === null ? "normal stress" : "normal force"]);
    const parts = series.map(([values, unit, label], n) => strip({ left, width, top: 8 + n * (high + 14), height: high }, times, values, until, unit, label, n === series.length - 1));
    this.strips.setAttribute("viewBox", `0 0 ${left + width + 14} ${8 + series.length * (high + 14) + 40}`);
    this.strips.setAttribute("aria-label", `velocity and friction over time: ${this.told.textContent}`);
    this.strips.replaceChildren(...parts);
  }

  // -- what leaves the page

  link() {
    const text = location.href.split("#")[0] + this.rig.hash();
    const done = () => (this.notice.textContent = "The link is copied.");
    const failed = () => (this.notice.textContent = text);
    if (navigator.clipboard) navigator.clipboard.writeText(text).then(done, failed);
    else failed();
  }

  save(name, type, text) {
    const address = URL.createObjectURL(new Blob([text], { type }));
    make("a", { href: address, download: `${this.rig.data.title}-${name}` }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  }

  /** The chart with its colours written out. */
  picture() {
    const copy = /** @type {any} */ (this.canvas.cloneNode(true));
    const live = this.canvas.querySelectorAll("*"), look = ["fill", "stroke", "stroke-width", "font-size", "font-family", "opacity"];
    copy.querySelectorAll("*").forEach((element, n) => {
      const style = getComputedStyle(live[n]);
      for (const name of look) element.setAttribute(name, style.getPropertyValue(name));
    });
    copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
    return new XMLSerializer().serializeToString(copy);
  }

  table() {
    const edges = new Map(this.edges().map((edge) => [edge.i, edge.at])), quoted = (text) => `"${String(text).replace(/"/g, '""')}"`;
    const rows = this.rig.data.parameters.map((one, i) => [quoted(one.name), this.rig.values[i] * one.factor, edges.has(i) ? edges.get(i) * one.factor : "", quoted(one.unit)].join(","));
    return ["parameter,value,nearest edge,unit", ...rows, ""].join("\n");
  }
}

/** Fill an element with the page of one rig. @param {HTMLElement} root @param {any} data @param {any} programs @param {any} machine @param {any} driver */
export function mount(root, data, programs, machine, driver) {
  return new Page(root, data, programs, machine, driver);
}
