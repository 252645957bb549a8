// What the rig does after a disturbance: curves over time, phase plane, events, the mechanism; one time for all of them.
import { button, make, svg } from "./dom.js";
import { ABSENT, UNKNOWN } from "./linear.js";
import { Mover } from "./mover.js";
import { plane, straight, strip } from "./plot.js";
import { digits, parse, shown, unitIn } from "./quantities.js";
import { Sketch } from "./sketch.js";
import { outcome, quantity } from "./words.js";

/** What can be done to a rig: in words, in which unit, what is usual (of the scales of the rig), how it reads. */
const DISTURBANCES = {
  velocity: { words: "step of the drive velocity", unit: "1", usual: () => 2, ratio: true },
  hold: { words: "hold of the load point", unit: "s", usual: ({ period }) => period, positive: true },
  push: { words: "push of the load point", unit: "m", usual: ({ slip }) => slip },
  normal: { words: "step of the normal stress", unit: "Pa", usual: ({ sigma }) => 0.05 * sigma },
  pull: { words: "pull on the block", unit: "Pa", usual: ({ tau }) => 0.01 * tau },
  blow: { words: "blow on the block, its velocity", unit: "1", usual: () => 10, ratio: true },
};
const HIGH = 105, PLANE = { left: 62, top: 8, width: 290, height: 220 }, LISTED = 200, FILM = 9000; // ms of the whole when it is played

export class Course {
  /** @type {any} */ course; // what the rig did last
  /** @type {any} */ before;
  /** @type {any} */ now; // its series as they are drawn
  /** @type {any[]} */ boxes;
  /** @type {any[]} */ dots;
  playing = 0;
  units = { size: "", length: "" }; // of what was typed last

  /** @param {import("./page.js").Page} page @param {() => any} library */
  constructor(page, library) {
    this.page = page;
    const { motion, still, sketch } = page.rig.data;
    this.mover = motion && new Mover(library, motion);
    this.box = make("section", { className: "motion", "aria-label": "motion" }, make("h2", { textContent: "What does it do?" }));
    this.told = make("p", { className: "told", role: "status" });
    this.done = make("p", { className: "hint" }); // to the rig, and when
    this.sketch = /** @type {any} */ (sketch ? new Sketch(sketch) : null);
    if (!this.mover) {
      this.box.append(make("p", { className: "told", textContent: `No motion on this page: ${still}.` }), ...(this.sketch ? [this.sketch.canvas] : []));
      return;
    }
    this.build();
  }

  build() {
    this.disturbance = make("select", { "aria-label": "disturbance" }, ...Object.entries(DISTURBANCES).map(([value, { words }]) => make("option", { value, textContent: words })));
    this.size = make("input", { type: "text", "aria-label": "size of the disturbance", size: 9 });
    this.length = make("input", { type: "text", "aria-label": "length of the run", size: 9, placeholder: "by itself" });
    this.halt = make("button", { type: "button", textContent: "stop", disabled: true, onclick: () => this.mover.stop() });
    this.disturbance.addEventListener("change", () => {
      this.size.value = this.size.placeholder = this.units.size = "";
      this.course = null;
      this.soon();
    });
    for (const name of ["size", "length"]) this[name].addEventListener("change", () => this.typed(name));
    this.strips = svg("svg", { class: "chart strips", role: "img" });
    this.strips.addEventListener("pointermove", (event) => this.point(event));
    this.strips.addEventListener("pointerdown", (event) => this.point(event));
    this.time = make("input", { type: "range", min: "0", max: "1000", step: "any", "aria-label": "time", className: "time" });
    this.time.addEventListener("input", () => this.show(Number(this.time.value) / 1000));
    this.player = button("▶", "play", () => this.play());
    this.reading = make("output", { className: "reading" });
    this.phase = svg("svg", { class: "chart phase", role: "img", viewBox: `0 0 ${PLANE.left + PLANE.width + 14} ${PLANE.top + PLANE.height + 46}` });
    this.events = make("tbody", {});
    const heads = ["begins", "lasts", "peak velocity", "stress drop", "since the last"];
    this.list = make("details", { className: "events" }, make("summary", { textContent: "Slip events" }),
      make("div", { className: "scroll", tabIndex: 0, role: "region", "aria-label": "slip events" }, make("table", {}, make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { textContent: text, scope: "col" })))), this.events)));
    this.box.append(
      make("p", { className: "pick" }, make("label", {}, "after a ", this.disturbance), make("label", {}, "of ", this.size), make("label", {}, "for ", this.length), this.halt),
      this.told, this.done, this.strips, make("p", { className: "clock" }, this.player, this.time, this.reading),
      make("div", { className: "pair" }, make("figure", {}, make("figcaption", { textContent: "Phase plane" }), this.phase), make("figure", {}, make("figcaption", { textContent: "The mechanism, seen from the load point" }), this.sketch.canvas)), this.list);
  }

  /** A bare number counts in the unit that the field shows, or showed before, and is written with it. */
  typed(name) {
    const field = this[name], unit = unitIn(field.value);
    if (!field.value) this.units[name] = "";
    else if (unit) this.units[name] = unit;
    else if (unitIn(`${field.value} s`)) field.value = `${field.value} ${this.units[name] || unitIn(field.placeholder)}`.trim();
    this.soon();
  }

  // -- running

  /** What was moved last becomes the curve of before. */
  keep() {
    this.before = this.course ?? this.before;
  }

  /** Move the rig once the page is drawn and values rest. */
  soon() {
    if (!this.mover) return;
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.move(), this.page.sliding ? 60 : 0);
  }

  async move() {
    const refused = this.refusal();
    this.quiet();
    clearTimeout(this.late);
    if (refused) {
      this.none(`No motion: ${refused}.`);
      return;
    }
    try {
      this.mover.forget();
      const asked = this.asked();
      this.halt.disabled = false;
      this.late = setTimeout(() => (this.told.textContent = "Computing the motion …"), 100);
      const told = (time) => (this.told.textContent = `Computing the motion … ${shown(time, "s", 3)} of ${shown(asked.until, "s", 3)} so far; curves are those of before.`);
      const found = await this.mover.run(this.model, this.page.answer.sigma, asked, told);
      clearTimeout(this.late);
      this.course = { ...found, until: found.status === "done" ? asked.until : found.end, disturbance: asked.disturbance, at: asked.from };
      this.told.textContent = outcome(this.course, this.page.rig.data.area);
      this.done.textContent = asked.words;
      this.draw();
    } catch (error) {
      clearTimeout(this.late);
      this.none(error instanceof Error ? error.message : String(error));
    }
    this.halt.disabled = true;
  }

  /** No motion belongs to what is asked for: why, without the curves of another. @param {string} why */
  none(why) {
    this.mover.forget();
    this.halt.disabled = true;
    this.keep();
    this.course = null;
    this.told.textContent = why;
    this.draw();
  }

  refusal() {
    const { answer, rig } = this.page, { motion, parameters, facts } = rig.data;
    const own = (name) => rig.values[parameters.findIndex((one) => one.name === name)];
    if (answer.status === ABSENT || answer.status === UNKNOWN) return "there is no steady sliding to start from";
    const added = motion.missing.find((name) => own(name) > 0);
    if (added) return `the rig of the file has no ${added}; write it there, and make the page anew`;
    const model = Array.from(rig.set(rig.values).R);
    this.model = motion.parameters.map((name) => model[facts.parameters.indexOf(name)]);
    return this.mover.own.set(this.model, answer.sigma).refusal(this.disturbance.value);
  }

  /** Size, begin and length as they stand in the fields, or what shows most. */
  asked() {
    const { eigenvalues, sigma, observed } = this.page.answer, lead = eigenvalues.find((s) => s.im > 0) ?? eigenvalues[0], { area } = this.page.rig.data;
    const disturbance = this.disturbance.value, { unit, usual, ratio, positive } = DISTURBANCES[disturbance];
    const period = Math.abs(lead.im > 0 ? (2 * Math.PI) / lead.im : 5 / (lead.re || 1)), per = unit === "Pa" ? area ?? 1 : 1, si = unit === "Pa" && area !== null ? "N" : unit;
    const until = this.length.value ? parse(this.length.value, "s", "s") : 12 * period;
    if (until === Infinity) throw new Error("a small disturbance grows or dies out too slowly to show; say how long the run lasts");
    const own = usual({ period: Math.min(period, until), slip: this.mover.own.scales.x, sigma, tau: observed.shear_stress ?? sigma }) * per;
    const size = this.size.value ? parse(this.size.value.replace(/^×\s*/, ""), si, si) : own;
    if (!(until > 0)) throw new Error("the length of a run is above 0 s");
    if (ratio && !(size > 0)) throw new Error("the velocity is multiplied by a number above 0");
    if (positive && !(size > 0)) throw new Error("a hold lasts for more than 0 s");
    this.size.placeholder = ratio ? `× ${own}` : shown(own, si, 3);
    this.length.placeholder = shown(12 * period, "s", 3);
    const at = disturbance === "blow" ? 0 : until / 20, much = ratio ? `× ${digits(size)}` : shown(size, si);
    const words = `${at ? `At ${shown(at, "s")} (dashed line)` : "At the start"}: ${DISTURBANCES[disturbance].words}, ${much}.`;
    return { disturbance, size: size / per, at: until / 20, from: at, until, words };
  }

  // -- drawing

  /** Series of a course, without what follows once it has run away. */
  series(course) {
    const most = 1e6 * this.mover.own.drive, end = course.status === "blow-up" ? course.v.findIndex((one) => one > most) : -1, { area } = this.page.rig.data;
    const [times, v, tau, sigma] = [course.times, course.v, course.tau, course.sigma].map((all) => (end < 0 ? all : all.subarray(0, end)));
    return { times, v, friction: tau.map((one, i) => one / sigma[i]), sigma: sigma.map((one) => one * (area ?? 1)) };
  }

  draw() {
    if (!this.mover) return;
    const { course } = this, shows = course ? "" : "none";
    for (const part of [this.done, this.strips, this.phase.parentElement, this.time.parentElement, this.list]) part.style.display = shows;
    if (!course) return;
    const past = this.before && this.before !== course && this.before.disturbance === course.disturbance ? [this.series(this.before)] : [], now = this.series(course), all = [...past, now];
    const { left, width } = this.page.size, { area } = this.page.rig.data, spread = Math.max(...now.sigma.reduce(([a, b], c) => [Math.min(a, c), Math.max(b, c)], [Infinity, -Infinity]).map((end, i) => (i ? end / now.sigma[0] - 1 : 1 - end / now.sigma[0])));
    const shownSeries = [["v", "m/s", "velocity"], ["friction", "1", "friction"]];
    if (spread > 1e-6) shownSeries.push(["sigma", area === null ? "Pa" : "N", "normal"]);
    this.boxes = shownSeries.map((_, n) => ({ left, width, top: 8 + n * (HIGH + 14), height: HIGH }));
    const parts = shownSeries.map(([name, unit, label], n) => strip(this.boxes[n], all.map((one) => ({ times: one.times, values: one[name] })), course.until, unit, label, n === shownSeries.length - 1));
    const bottom = this.boxes[this.boxes.length - 1].top + HIGH;
    this.cursor = svg("line", { class: "cursor", y1: this.boxes[0].top, y2: bottom });
    const when = left + straight(0, course.until).of(course.at) * width, step = svg("line", { class: "step", x1: when, x2: when, y1: this.boxes[0].top, y2: bottom });
    this.dots = shownSeries.map(() => svg("circle", { class: "at", r: 4 }));
    this.strips.setAttribute("viewBox", `0 0 ${left + width + 14} ${bottom + 40}`);
    this.strips.setAttribute("aria-label", `velocity and friction over time: ${this.told.textContent}`);
    this.strips.replaceChildren(...parts.map((part) => part.group), ...(when < left + width ? [step] : []), this.cursor, ...this.dots);
    const drawn = plane(PLANE, all.map((one) => ({ x: one.v, y: one.friction })), ["m/s", "velocity"], ["1", "friction"]);
    this.mark = svg("circle", { class: "at", r: 5 });
    this.phase.setAttribute("aria-label", "friction over velocity");
    this.phase.replaceChildren(drawn.group, this.mark);
    this.now = { ...now, names: shownSeries.map(([name]) => name), ups: parts.map((part) => part.up), plane: drawn };
    this.sketch.take(course);
    this.table();
    this.show(Number(this.time.value) / 1000 || 0);
  }

  table() {
    const { events } = this.course, { area } = this.page.rig.data, from = Math.max(0, events.length - LISTED);
    this.list.style.display = events.length ? "" : "none";
    this.list.firstChild.textContent = `${events.length} slip event${events.length === 1 ? "" : "s"}${from ? `, the last ${LISTED} of them` : ""}`;
    this.events.replaceChildren(...events.slice(from).map((one, n) => {
      const go = button(shown(one.begin, "s"), `go to ${shown(one.begin, "s")}`, () => this.show(one.begin / this.course.until)), before = events[from + n - 1];
      const cells = [go, shown(one.end - one.begin, "s", 3), shown(one.peak, "m/s", 3), quantity(one.drop, "Pa", area), before ? shown(one.begin - before.begin, "s", 3) : ""];
      return make("tr", {}, ...cells.map((cell) => make("td", {}, cell)));
    }));
  }

  // -- the time that all of it shows

  point(event) {
    if (!this.course) return;
    const place = this.strips.getBoundingClientRect(), { left, width } = this.page.size, unit = (left + width + 14) / place.width;
    this.quiet();
    this.show(((event.clientX - place.left) * unit - left) / width);
  }

  /** @param {number} share of the run */
  show(share) {
    if (!this.course || !this.now.times.length) return;
    const at = Math.min(1, Math.max(0, share)) * this.course.until, { times, v, friction, sigma, plane: drawn } = this.now, { left, width } = this.page.size;
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= at) low = middle;
      else high = middle;
    }
    const part = times[high] > times[low] ? Math.min(1, Math.max(0, (at - times[low]) / (times[high] - times[low]))) : 0, between = (all) => all[low] + part * (all[high] - all[low]);
    const x = left + straight(0, this.course.until).of(at) * width;
    this.time.value = String(1000 * share);
    this.time.setAttribute("aria-valuetext", shown(at, "s"));
    this.cursor.setAttribute("x1", x.toFixed(1));
    this.cursor.setAttribute("x2", x.toFixed(1));
    this.dots.forEach((dot, n) => {
      const y = this.boxes[n].top + (1 - this.now.ups[n].of(between(this.now[this.now.names[n]]))) * HIGH;
      dot.setAttribute("cx", x.toFixed(1));
      dot.setAttribute("cy", y.toFixed(1));
    });
    this.mark.setAttribute("cx", (PLANE.left + drawn.across.of(between(v)) * PLANE.width).toFixed(1));
    this.mark.setAttribute("cy", (PLANE.top + (1 - drawn.up.of(between(friction))) * PLANE.height).toFixed(1));
    this.sketch.place(between(this.course.x), between(this.course.load));
    const normal = shown(between(sigma), this.page.rig.data.area === null ? "Pa" : "N");
    this.reading.textContent = `${shown(at, "s")}: ${shown(between(v), "m/s", 3)}, friction ${between(friction).toPrecision(4)}, ${normal}`;
  }

  play() {
    if (this.playing) return this.quiet();
    const began = performance.now(), from = Number(this.time.value) >= 999 ? 0 : Number(this.time.value) / 1000;
    const frame = (now) => {
      const share = from + Math.max(0, now - began) / FILM;
      this.show(share);
      if (share < 1) this.playing = requestAnimationFrame(frame);
      else this.quiet();
    };
    this.player.textContent = "❚❚";
    this.player.setAttribute("aria-label", "pause");
    this.playing = requestAnimationFrame(frame);
  }

  quiet() {
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    this.player.textContent = "▶";
    this.player.setAttribute("aria-label", "play");
  }
}
