// Motion after a disturbance: curves over time, phase plane, events and moving sketch, with one time cursor for all.
import { DISTURBANCES, Refused, asked, called } from "./disturbances.js";
import { button, copy, make, putAt, svg, tell, unbroken } from "./dom.js";
import { ABSENT, UNKNOWN } from "./linear.js";
import { Mover } from "./mover.js";
import { plane, straight, strip } from "./plot.js";
import { shown, unitIn } from "./quantities.js";
import { MachineSketch, Sketch } from "./sketch.js";
import { outcome, shed, slow } from "./words.js";

/** @typedef {{times: any, shown: [any, string, string][], plane: [number, number]}} View series with unit and label; indices of those of the phase plane */

const LEAD = 0.08, BRIEF = 1e-6; // LEAD: part of the time after the disturbance that is drawn before it; BRIEF: time after the disturbance over that before it, below which the whole run is drawn
const AWAY = 1e6; // velocity over that of steady sliding above which a run-away is not drawn
const STILL = 1e-15, LOOSE = 1e-3; // slip rate and normal force over those of steady sliding below which the contact counts as stuck and as open
const HIGH = 105, PLANE = { left: 70, top: 8, width: 290, height: 220 }, LISTED = 200, FILM = 9000; // HIGH: height of a strip and PLANE: box of the phase plane, SVG units; LISTED: most events in the list; FILM: duration of replay, ms

/** Place of a point of the phase plane. @param {any} phase @param {number} x @param {number} y */
const spot = ({ across, up }, x, y) => ({ cx: PLANE.left + across.of(x) * PLANE.width, cy: PLANE.top + (1 - up.of(y)) * PLANE.height });

export class Course {
  /** @type {any} */ course; // result of the last run
  /** @type {any} */ before;
  /** @type {any} */ now; // series of the last run as drawn
  /** @type {any[]} */ boxes;
  /** @type {any[]} */ dots;
  choose = () => {}; // updates the choice of bodies or contacts that a disturbance acts on
  playing = 0;
  units = { size: "", length: "" }; // units of the last typed size and length

  /** @param {import("./page.js").Page} page @param {() => any} library */
  constructor(page, library) {
    this.page = page;
    const { motion, still, sketch } = page.rig.data;
    if (motion) motion.parameters ??= page.rig.data.facts.parameters;
    this.mover = motion && new Mover(library, motion);
    this.box = make("section", { className: "motion", "aria-label": "motion", tabIndex: -1 }, make("h2", { textContent: "What does it do?" }));
    this.told = make("p", { className: "told", role: "status" });
    this.done = make("p", { className: "hint" }); // text: disturbance and time
    this.sketch = /** @type {any} */ (page.rig.data.phrases ? new MachineSketch(sketch, motion?.bodies ?? []) : new Sketch(sketch));
    if (!this.mover) {
      this.box.append(make("p", { className: "told", textContent: `No motion on this page: ${still}.` }), this.sketch.canvas);
      return;
    }
    this.build();
  }

  build() {
    this.taken = make("p", { className: "bare", id: `bare-${Math.random().toString(36).slice(2)}`, textContent: "A bare number counts in the unit that its field shows." });
    this.disturbance = make("select", { "aria-label": "after a disturbance" }, ...Object.keys(DISTURBANCES).map((value) => make("option", { value, textContent: called(value, this.page.rig.data) })));
    this.size = make("input", { type: "text", "aria-label": "of: size of the disturbance", size: 9, "aria-describedby": this.taken.id });
    this.length = make("input", { type: "text", "aria-label": "for: length of the run", size: 9, placeholder: "by itself", "aria-describedby": this.taken.id });
    this.halt = make("button", { type: "button", textContent: "stop", disabled: true, onclick: () => this.mover.stop() });
    const { motion } = this.page.rig.data, { contacts, bodies, shares } = motion, named = [...contacts, ...bodies.map(([name]) => name)].filter(Boolean);
    this.on = make("select", { "aria-label": "on: where it acts", onchange: () => this.forget() });
    this.where = make("label", {}, "on ", this.on);
    this.view = make("select", { "aria-label": "shown: contact or body", onchange: () => (this.draw(), this.page.note()) }, ...named.map((name, n) => make("option", { value: String(n), textContent: `${n < contacts.length ? "contact" : "body"} ${name}` })));
    this.shown = make("label", { hidden: !named.length }, "shown: ", this.view);
    this.choose = () => {
      const names = Object.keys(shares[this.disturbance.value] ?? {}).filter(Boolean);
      this.on.replaceChildren(...names.map((name) => make("option", { value: name, textContent: name })));
      this.where.hidden = !names.length;
    };
    this.choose();
    this.disturbance.addEventListener("change", () => {
      this.choose();
      this.forget();
    });
    for (const name of ["size", "length"]) {
      this[name].addEventListener("change", () => this.typed(name));
      this[name].addEventListener("keydown", (event) => {
        if (event.key !== "Escape") return;
        this[name].value = this.units[name] = "";
        this.soon();
      });
    }
    this.strips = svg("svg", { class: "chart strips", role: "img", "aria-label": "motion over time" });
    this.strips.addEventListener("pointermove", (event) => this.point(event));
    this.strips.addEventListener("pointerdown", (event) => this.point(event));
    this.time = make("input", { type: "range", min: "0", max: "1000", step: "any", "aria-label": "time", className: "time" });
    this.time.addEventListener("input", () => this.show(Number(this.time.value) / 1000));
    this.player = button("▶", "play", () => this.play());
    this.reading = make("output", { className: "reading" });
    this.phase = svg("svg", { class: "chart phase", role: "img", "aria-label": "phase plane", viewBox: `0 0 ${PLANE.left + PLANE.width + 14} ${PLANE.top + PLANE.height + 46}` });
    this.events = make("tbody", {});
    const mark = (className, words) => make("span", {}, svg("svg", { class: "chart", viewBox: "0 0 14 14", "aria-hidden": "true" }, svg("circle", { class: className, cx: 7, cy: 7, r: 4 })), words);
    const key = make("p", { className: "key" }, mark("begin", "where it begins"), mark("at", "at the time chosen"));
    const { area, phrases, levers = [] } = this.page.rig.data, torques = levers.filter(Boolean).length;
    const drop = torques ? (torques < levers.length ? "drop" : "drop of torque") : phrases || area !== null ? "drop of force" : "stress drop";
    const heads = [...(phrases ? ["contact"] : []), "begins", "lasts", "peak velocity", drop, "since the last"];
    this.list = make("details", { className: "events" }, make("summary", { textContent: "Slip events" }),
      make("div", { className: "scroll", tabIndex: 0, role: "region", "aria-label": "slip events" }, make("table", {}, make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { textContent: text, scope: "col" })))), this.events)));
    this.file = make("pre", { tabIndex: 0 });
    this.same = make("details", {}, make("summary", { textContent: "The same run with steadyslip simulate" }),
      make("p", { className: "bare", textContent: "Put this at the end of the rig file, in place of its own [protocol]:" }), this.file,
      button("copy", "copy the protocol", () => copy(this.file.textContent).then(() => this.page.say("The protocol is copied."), () => this.page.say("This browser copies nothing; select the text."))));
    this.box.append(
      make("p", { className: "pick" }, make("label", {}, "after a ", this.disturbance), this.where, make("label", {}, "of ", this.size), make("label", {}, "for ", this.length), this.halt),
      this.taken, this.told, this.done, make("p", { className: "pick" }, this.shown), this.strips, make("p", { className: "clock" }, this.player, this.time, this.reading),
      make("div", { className: "pair" }, make("figure", {}, make("figcaption", { textContent: "Phase plane" }), this.phase, key), make("figure", { className: motion.bodies.length ? "wide" : "" }, make("figcaption", { textContent: this.sketch.caption }), this.sketch.canvas)), this.list, this.same);
  }

  /** Name of the contact or body that is shown. */
  viewed() {
    return this.view.selectedOptions[0]?.textContent ?? "";
  }

  /** Show the contact or body of the given name, if there is one. @param {string} name */
  look(name) {
    const found = [...this.view.options].find((one) => one.textContent === name);
    if (found) this.view.value = found.value;
  }

  /** Apply a change of disturbance: reset sizes and drop the old curves. */
  forget() {
    this.size.value = this.size.placeholder = this.units.size = "";
    this.course = null;
    this.soon();
  }

  /** Add the unit shown in a field, now or before, to a number typed without one. */
  typed(name) {
    const field = this[name], unit = unitIn(field.value);
    if (!field.value) this.units[name] = "";
    else if (unit) this.units[name] = unit;
    else if (unitIn(`${field.value} s`)) field.value = `${field.value} ${this.units[name] || unitIn(field.placeholder)}`.trim();
    this.soon();
  }

  // -- running

  /** Keep the last run as the faint curve for comparison. */
  keep() {
    this.before = this.course ?? this.before;
  }

  /** Start a run once the page is drawn and values no longer change. */
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
    for (const field of [this.size, this.length]) field.removeAttribute("aria-invalid");
    try {
      this.mover.forget();
      const wanted = asked(this.page, this.mover.own, { kind: this.disturbance.value, on: this.on.value, size: this.size.value, length: this.length.value });
      [this.size.placeholder, this.length.placeholder] = wanted.usual;
      this.file.textContent = wanted.file;
      this.page.note();
      this.halt.disabled = false;
      this.late = setTimeout(() => (this.told.textContent = "Computing the motion …"), 100);
      const told = (time) => (this.told.textContent = `Computing the motion … ${shown(time, "s", 3)} of ${shown(wanted.until, "s", 3)} so far; curves are those of before.`);
      const found = await this.mover.run(this.model, this.page.answer.sigmas, wanted, told);
      clearTimeout(this.late);
      this.mover.own.sliding.forEach(({ rate, area: own }, n) => Object.assign(found.contacts[n], { floor: STILL * Math.abs(rate), pressed: LOOSE * this.page.answer.sigmas[n] * own, lever: this.model[this.page.rig.data.motion.parameters.indexOf(this.page.rig.data.levers?.[n])] ?? null }));
      this.course = { ...found, until: found.status === "done" ? wanted.until : found.end, disturbance: wanted.disturbance + wanted.on, at: wanted.from };
      const { at, until } = this.course;
      this.course.since = until - at > BRIEF * at ? Math.max(0, at - LEAD * (until - at)) : 0; // the curves begin just before the disturbance
      this.told.textContent = unbroken(outcome(this.course, this.page.rig.data));
      this.done.textContent = wanted.words;
      this.draw();
    } catch (error) {
      clearTimeout(this.late);
      if (error instanceof Refused) this[error.field].setAttribute("aria-invalid", "true");
      this.none(error instanceof Error ? error.message : String(error));
    }
    this.halt.disabled = true;
  }

  /** Show why there is no motion, and remove the curves of other runs. @param {string} why */
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
    if (answer.status === ABSENT || answer.status === UNKNOWN) return this.page.rig.data.ends["no steady sliding"];
    const added = motion.missing.find((name) => own(name) > 0);
    if (added) return `the rig of the file has no ${added}; write it there, and make the page anew`;
    const model = Array.from(rig.set(rig.values).R);
    this.model = motion.parameters.map((name) => model[facts.parameters.indexOf(name)]);
    const moved = this.mover.own.set(this.model, answer.sigmas);
    for (const one of this.disturbance.options) one.disabled = !one.selected && moved.infinite(one.value);
    return moved.refusal(this.disturbance.value);
  }

  // -- drawing

  /** Series of a run to show for a contact or body, cut where it runs away. @returns {View} */
  series(course) {
    const { area, phrases } = this.page.rig.data, { sliding } = this.mover.own, n = Number(this.view.value || 0);
    const end = course.status === "blow-up" ? Math.min(...course.contacts.map((one, i) => one.v.findIndex((v) => v > AWAY * sliding[i].rate)).filter((at) => at >= 0), course.times.length) : course.times.length;
    const cut = (all) => all.subarray(0, end), times = cut(course.times);
    if (n >= course.contacts.length) {
      const { unit, x, v } = course.bodies[n - course.contacts.length];
      return { times, shown: [[cut(v), `${unit}/s`, "velocity"], [cut(x), unit, "ahead"]], plane: [1, 0] };
    }
    const { v, tau, sigma, floor, pressed } = course.contacts[n], friction = cut(tau).map((one, i) => (sigma[i] > pressed ? one / sigma[i] : NaN)), normal = area ? cut(sigma).map((one) => one * area) : cut(sigma);
    const moving = cut(v).map((one) => (Math.abs(one) < floor ? floor : one)), si = area === null && !phrases ? "Pa" : "N"; // slower velocities are drawn at the floor
    return { times, shown: [[moving, "m/s", "velocity"], [friction, "1", "friction"], [normal, si, `normal ${si === "N" ? "force" : "stress"}`]], plane: [0, 1] };
  }

  draw() {
    if (!this.mover) return;
    const { course } = this, drawn = course?.until > course?.since, shows = drawn ? "" : "none"; // a run that ends as it begins has no curves
    for (const part of [this.done, this.strips, this.phase.parentElement, this.time.parentElement, this.list, this.same]) part.style.display = shows;
    if (!drawn) return;
    const past = this.before && this.before !== course && this.before.disturbance === course.disturbance ? [this.series(this.before)] : [], now = this.series(course), all = [...past, now];
    const { left, width } = this.page.size, { plane: [across, up] } = now, steady = (values) => values.every((one) => Math.abs(one - values[0]) <= 1e-6 * Math.abs(values[0]));
    const strips = now.shown.map((_, n) => n).filter((n) => n < 2 || !steady(now.shown[n][0]));
    this.boxes = strips.map((_, row) => ({ left, width, top: 8 + row * (HIGH + 14), height: HIGH }));
    const parts = strips.map((n, row) => strip(this.boxes[row], all.map((one) => ({ times: one.times, values: one.shown[n][0] })), [course.since, course.until], now.shown[n][1], now.shown[n][2], row === strips.length - 1));
    const bottom = this.boxes[this.boxes.length - 1].top + HIGH;
    this.cursor = svg("line", { class: "cursor", y1: this.boxes[0].top, y2: bottom });
    const when = left + straight(course.since, course.until).of(course.at) * width, step = svg("line", { class: "step", x1: when, x2: when, y1: this.boxes[0].top, y2: bottom });
    this.dots = strips.map(() => svg("circle", { class: "at", r: 4 }));
    this.strips.setAttribute("viewBox", `0 0 ${left + width + 14} ${bottom + 40}`);
    this.strips.setAttribute("aria-label", `${now.shown.map(([, , label]) => label).join(", ")} over time: ${this.told.textContent}`);
    this.strips.replaceChildren(...parts.map((part) => part.group), ...(when < left + width ? [step] : []), ...(course.status === "blow-up" ? [svg("line", { class: "blow-up", x1: left + width, x2: left + width, y1: this.boxes[0].top, y2: bottom })] : []), this.cursor, ...this.dots);
    const named = (n) => /** @type {[string, string]} */ ([now.shown[n][1], now.shown[n][2]]);
    const phase = plane(PLANE, all.map((one) => ({ x: one.shown[across][0], y: one.shown[up][0] })), named(across), named(up));
    this.mark = svg("circle", { class: "at", r: 5 });
    const begin = svg("circle", { class: "begin", r: 5 });
    putAt(begin, spot(phase, now.shown[across][0][0], now.shown[up][0][0]));
    this.phase.setAttribute("aria-label", `${now.shown[up][2]} over ${now.shown[across][2]}`);
    this.phase.replaceChildren(phase.group, begin, this.mark);
    this.now = { ...now, strips, ups: parts.map((part) => part.up), phase };
    this.sketch.take(course);
    this.table();
    this.show(Number(this.time.value) / 1000 || 0);
  }

  table() {
    const { events } = this.course, { area, phrases } = this.page.rig.data, from = Math.max(0, events.length - LISTED);
    this.list.style.display = events.length ? "" : "none";
    this.list.firstChild.textContent = `${events.length} slip event${events.length === 1 ? "" : "s"}${from ? `, the last ${LISTED} of them` : ""}`;
    this.events.replaceChildren(...events.slice(from).map((one) => {
      const go = button(shown(one.begin, "s"), `go to ${shown(one.begin, "s")}`, () => this.show((one.begin - this.course.since) / (this.course.until - this.course.since)));
      const cells = [...(phrases ? [one.contact] : []), go, shown(one.end - one.begin, "s", 3), shown(one.peak, "m/s", 3), shed(one.drop, this.course.contacts.find(({ name }) => name === one.contact), { area, phrases }), one.every !== null ? shown(one.every, "s", 3) : ""];
      return make("tr", {}, ...cells.map((cell) => make("td", {}, cell)));
    }));
  }

  // -- time cursor

  point(event) {
    if (!this.course) return;
    const place = this.strips.getBoundingClientRect(), { left, width } = this.page.size, unit = (left + width + 14) / place.width;
    this.quiet();
    this.show(((event.clientX - place.left) * unit - left) / width);
  }

  /** Show the run at a time. @param {number} share of its duration, 0 to 1 */
  show(share) {
    if (!this.course || !this.now.times.length) return;
    const { since, until } = this.course, at = since + Math.min(1, Math.max(0, share)) * (until - since), { times, shown: series, strips, phase, plane: [across, up] } = this.now, { left, width } = this.page.size;
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= at) low = middle;
      else high = middle;
    }
    const part = times[high] > times[low] ? Math.min(1, Math.max(0, (at - times[low]) / (times[high] - times[low]))) : 0, between = (all) => all[low] + part * (all[high] - all[low]);
    const x = left + straight(this.course.since, this.course.until).of(at) * width;
    this.time.value = String(1000 * share);
    this.time.setAttribute("aria-valuetext", shown(at, "s"));
    putAt(this.cursor, { x1: x, x2: x });
    this.dots.forEach((dot, n) => putAt(dot, { cx: x, cy: this.boxes[n].top + (1 - this.now.ups[n].of(between(series[strips[n]][0]))) * HIGH }));
    putAt(this.mark, spot(phase, between(series[across][0]), between(series[up][0])));
    this.sketch.place(between, this.course);
    const { floor = 0 } = this.course.contacts[Number(this.view.value || 0)] ?? {};
    const now = series.map(([values, unit, label]) => (unit === "1" ? `friction ${Number.isNaN(between(values)) ? "–" : between(values).toPrecision(4)}` : label === "velocity" && floor ? `velocity ${slow(between(values), 1.5 * floor)}` : `${label === "ahead" ? "ahead by" : label} ${shown(between(values), unit, unit === "N" || unit === "Pa" ? 4 : 3)}`));
    this.reading.textContent = `${shown(at, "s")}: ${now.join(", ")}`;
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
