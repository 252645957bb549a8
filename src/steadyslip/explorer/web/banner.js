// Banner: the verdict, its reason, and a bar with the stable values of one parameter.
import { inMenu } from "./controls.js";
import { make, put, svg, tell, unbroken } from "./dom.js";
import { ABSENT, STABLE, UNDAMPED, isQuiet } from "./linear.js";
import { ticks } from "./plot.js";
import { apart, digits, told, unitFor } from "./quantities.js";
import { asStiffness, besides, beyondWords, headline, kindOf, kindWords, reason } from "./words.js";

const DECADE = Math.log(10); // natural logarithm of ten: margin of the bar beyond its outermost marks
const ASUNDER = 1e3; // largest ratio of marks that are written in one unit
const WIDTH = 7.4; // width of a letter on the bar, SVG units

/** Update marks or labels of a bar (class, position in per cent, text); elements that are unchanged stay. */
function placed(box, rows, name) {
  while (box.children.length > rows.length) box.lastChild.remove();
  while (box.children.length < rows.length) box.append(make(name, {}));
  rows.forEach(([kind, place, text], n) => {
    const one = box.children[n];
    put(one, "class", kind);
    put(one, "style", `left: ${place.toFixed(2)}%`);
    tell(one, text);
  });
}

export class Banner {
  /** @param {import("./page.js").Page} page @param {string[]} differs results that differ from those of Python, in words */
  constructor(page, differs) {
    this.page = page;
    this.data = page.rig.data;
    this.sentence = make("h1", {});
    this.reason = make("p", {});
    this.paths = ["unstable", "unknown", "stable"].map((name) => svg("path", { class: name }));
    this.marks = make("div", {});
    this.labels = make("div", {});
    this.bar = make("div", { className: "bar", role: "img" }, svg("svg", { viewBox: "0 0 100 10", preserveAspectRatio: "none" }, ...this.paths), this.marks, this.labels);
    this.notice = make("p", { className: "notice", role: "status" });
    if (differs.length) this.notice.textContent = `This browser computes otherwise than Python did (${differs.slice(0, 3).join("; ")}): do not rely on this page.`;
    this.choice = make("select", { "aria-label": "parameter of the bar" }, ...this.data.parameters.map((one, i) => make("option", { value: one.name, textContent: inMenu(one, this.data.parameters), selected: i === page.rig.bar })));
    this.choice.addEventListener("change", () => page.tell(this.choice.selectedIndex));
    this.values = make("p", { className: "values" }, make("label", {}, "parameter of the bar: ", this.choice));
    const ask = (kind) => make("button", { type: "button", textContent: kindWords(kind, this.data), onclick: () => page.guessed(kind) });
    const guess = make("p", { className: "guess" }, "Will it slide steadily at these values? It is ", ask("stable"), " ", ...(page.rig.assess().status === UNDAMPED ? [ask("undamped"), " "] : []), ask("unstable"), " ", ask("none"));
    this.box = make("section", { className: "verdict", "aria-label": "verdict", tabIndex: -1 }, make("div", { "aria-live": "polite" }, this.sentence, this.reason), make("div", {}, this.values, this.bar), this.notice, guess);
  }

  show(answer) {
    const { phrases } = this.data;
    this.box.dataset.kind = kindOf(answer);
    tell(this.sentence, unbroken(headline(answer, this.speed(), this.data)));
    if (!phrases || !this.page.tracks) tell(this.reason, unbroken(phrases ? this.told(answer) : reason(answer, this.data) + besides(answer, this.data)));
    this.showBar(answer);
  }

  /** Text of the velocity of the drive, as in headlines of Python. */
  speed() {
    const { parameters, speed } = this.data, i = parameters.findIndex((one) => one.name === speed);
    return `at ${told(parameters[i], this.page.rig.values[i])}`;
  }

  /** Update what depends on edges: the reason for the verdict on a machine, and the bar. @param {any} answer @param {any} [first] */
  follow(answer, first) {
    if (this.data.phrases) tell(this.reason, unbroken(this.told(answer, first)));
    this.choice.selectedIndex = this.page.rig.bar;
    this.showBar(answer);
  }

  told(answer, first) {
    const { rig } = this.page, own = Array.from(rig.set(rig.values).R);
    if (!first) return reason({ ...answer, own }, this.data);
    const one = this.data.parameters[first.i], beyond = first.beyond === STABLE ? this.data.phrases.stable : beyondWords(first, this.page);
    const edge = { name: one.title, side: first.at > rig.values[first.i] ? "above" : "below", value: told(one, first.at, apart(rig.values[first.i], first.at)), beyond };
    return reason({ ...answer, own }, this.data, edge);
  }

  /** Contents of the bar, from the exact stable set or from the track: stable intervals, own value, scale to 0 ... 1. */
  drawn(answer) {
    const { page, data } = this, { rig } = page, one = data.parameters[rig.bar], own = answer.stiffness + answer.gain;
    const whole = data.phrases || this.springs(answer);
    if (whole && answer.intervals && answer.status !== ABSENT && (!data.phrases || own > 0)) {
      const { gain } = answer, told = data.phrases ? one : asStiffness(data);
      const intervals = answer.intervals.map(({ low, high }) => ({ low: low + gain, high: high + gain }));
      const ends = answer.intervals.flatMap(({ low, high }) => [low, high]).filter((k) => k > 0 && Number.isFinite(k)).map((k) => k + gain);
      const marks = [...ends, own, gain].filter((k) => k > 0);
      if (!marks.length) return null;
      const low = Math.log(Math.min(...marks)) - DECADE, high = Math.log(Math.max(...marks)) + DECADE;
      const x = (k) => (k > 0 ? (Math.log(k) - low) / (high - low) : 0);
      return { told, word: kindWords("stable", data), intervals, ends, own, gain, x, range: [Math.exp(low), Math.exp(high)], logarithmic: true };
    }
    if (!page.tracks || rig.bar < 0) return null;
    const scale = page.scale(rig.bar), range = page.ranges[rig.bar], parts = page.tracks[rig.bar], logarithmic = range[0] > 0 && range[1] / range[0] > 30;
    const intervals = parts.flatMap(({ status, at }, n) => (isQuiet(status) ? [{ low: n ? parts[n - 1].at : -Infinity, high: n + 1 < parts.length ? at : Infinity }] : []));
    return { told: one, word: kindWords(parts.some(({ status }) => status === UNDAMPED) ? "undamped" : "stable", data), intervals, ends: parts.slice(0, -1).map(({ at }) => at), own: rig.values[rig.bar], gain: 0, x: (v) => (Number.isFinite(v) ? scale.of(v) : Number(v > 0)), range, logarithmic };
  }

  /** True if the bar shows a spring stiffness, perhaps with a gain added, rather than another parameter or a gain alone. */
  springs({ gain, stiffness }) {
    return this.data.parameters[this.page.rig.bar]?.name === this.data.stiffness && (!gain || stiffness > 0);
  }

  /** Draw the stable values of the chosen parameter (stiffness plus gain of a controller) with the rig's own value. */
  showBar(answer) {
    const found = this.drawn(answer);
    this.bar.hidden = !found;
    if (!found) return put(this.bar, "aria-label", "no stiffness is stable");
    const { told: one, word, intervals, ends, own, gain, logarithmic } = found, { phrases, parameters } = this.data, { bar } = this.page.rig;
    const whole = !phrases && this.springs(answer), marks = [...ends, own, gain].filter((v) => v > 0), [factor, name] = unitFor(one, own || marks[0] || 1);
    const together = logarithmic && Math.max(...marks) < ASUNDER * Math.min(...marks);
    const value = (v) => (together ? `${digits(v / factor)} ${name}`.trim() : told(one, v)); // one unit for all marks, unless they span decades
    const x = (v) => 100 * Math.min(1, Math.max(0, found.x(v)));
    const least = gain > 0 ? `M0 0H${x(gain)}V10H0Z` : ""; // total stiffness cannot be below the gain
    const drawn = `M0 0H100V10H0Z|${least}|${intervals.map(({ low, high }) => `M${x(low)} 0H${x(high)}V10H${x(low)}Z`).join("")}`.split("|");
    this.paths.forEach((path, n) => put(path, "d", drawn[n]));
    const [size] = unitFor(one, found.range[1]), scale = ticks(found.range[0] / size, found.range[1] / size, logarithmic, 4).map((v) => v * size).filter((v) => x(v) > 6 && x(v) < 94);
    const marked = [...scale.map((v) => ["tick", x(v), ""]), ["own", x(own), ""], ...ends.map((v) => ["edge", x(v), ""])];
    const begins = new Set(intervals.map(({ low }) => low)), closes = new Set(intervals.map(({ high }) => high)), words = whole ? (gain > 0 ? `gain${own > gain ? " and stiffness" : ""} ` : "stiffness ") : "";
    const labels = [...ends].sort((a, b) => Math.abs(x(a) - x(own)) - Math.abs(x(b) - x(own))).map((v) => ["", x(v), `${begins.has(v) ? `${word} from` : closes.has(v) ? (intervals.some((one) => one.high === v && ends.includes(one.low)) ? "to" : `${word} to`) : "from"} ${value(v)}`]);
    if (own > gain && gain > 0 && !ends.length) labels.push(["", x(gain), `the gain alone ${value(gain)}`]);
    placed(this.marks, marked, "i");
    placed(this.labels, [...this.fitted(scale.map((v) => ["tick", x(v), value(v)])), ...this.fitted([["now", x(own), `${words}now ${value(own)}`]]), ...this.fitted(labels)], "span");
    const starts = (low) => low > (whole || phrases ? gain : -Infinity) && low > -Infinity; // otherwise the interval begins at the lowest possible value
    const said = intervals.map(({ low, high }) => (high < Infinity ? (starts(low) ? `${value(low)} to ${value(high)}` : `below ${value(high)}`) : starts(low) ? `above ${value(low)}` : "any"));
    const what = whole ? (gain > 0 ? `stiffness and gain together, of which the gain is ${value(gain)}` : "stiffness") : `values of ${parameters[bar].title}`;
    put(this.bar, "aria-label", `${word} ${what}: ${said.join(", or ") || "none"}`);
  }

  /** Place the labels of one row within the bar, most important first; labels that would overlap are left out. */
  fitted(labels) {
    const wide = this.page.wide, taken = /** @type {[number, number][]} */ ([]);
    return labels.flatMap(([kind, at, text]) => {
      const half = Math.min(50, (50 * WIDTH * text.length) / wide), place = Math.min(100 - half, Math.max(half, at));
      if (taken.some(([from, to]) => place + half > from && place - half < to)) return [];
      taken.push([place - half, place + half]);
      return [[kind, place, text]];
    });
  }
}
