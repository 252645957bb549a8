// The verdict: a sentence, why, and a bar of the stable stiffnesses.
import { make, put, svg, tell } from "./dom.js";
import { ABSENT } from "./linear.js";
import { ticks } from "./plot.js";
import { digits, display, shown } from "./quantities.js";
import { headline, kindBeyond, kindOf, machineReason, reason } from "./words.js";

const DECADE = Math.log(10); // on both sides of what is marked
const ASUNDER = 1e3; // between marks that share a unit

/** Marks or labels of a bar: class, place in per cent and text; only what is new is written. */
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
  /** @param {import("./page.js").Page} page @param {string[]} differs what this browser computes otherwise than Python did */
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
    const { bars, parameters, stiffness } = this.data;
    this.choice = make("select", { "aria-label": "parameter of the bar" }, ...(bars ?? []).map((name) => make("option", { value: name, textContent: name, selected: name === stiffness })));
    this.choice.addEventListener("change", () => page.tell(parameters.findIndex((one) => one.name === this.choice.value)));
    this.values = make("p", { className: "values", hidden: !bars?.length }, make("label", {}, "stable values of ", this.choice));
    this.box = make("section", { className: "verdict", "aria-label": "verdict" }, make("div", { "aria-live": "polite" }, this.sentence, this.reason), make("div", {}, this.values, this.bar), this.notice);
  }

  show(answer) {
    const { parameters, speed, phrases } = this.data, { values } = this.page.rig, drive = parameters.findIndex((one) => one.name === speed);
    this.box.dataset.kind = kindOf(answer);
    tell(this.sentence, headline(answer, shown(values[drive], parameters[drive].unit)));
    if (!phrases || !this.page.tracks) tell(this.reason, phrases ? this.told(answer) : reason(answer, this.data));
    this.showBar(answer);
  }

  /** The reason of a machine with its nearest edge, once that is known. @param {any} answer @param {any} [first] */
  showNearest(answer, first) {
    if (this.data.phrases) tell(this.reason, this.told(answer, first));
  }

  told(answer, first) {
    const { rig } = this.page, own = Array.from(rig.set(rig.values).R);
    if (!first) return machineReason({ ...answer, own }, this.data);
    const one = this.data.parameters[first.i], kind = kindBeyond(rig.assess(this.page.with(first.i, first.landing)));
    const edge = { name: one.name, side: first.at > rig.values[first.i] ? "above" : "below", value: shown(first.at * one.factor, one.unit), kind };
    return machineReason({ ...answer, own }, this.data, edge);
  }

  /** The stable stiffnesses, controller's gain included, on a logarithmic bar, with the rig's own. */
  showBar(answer) {
    const { gain } = answer, own = answer.stiffness + gain; // a controller's gain counts as the sentence counts it
    const { phrases, parameters, area } = this.data, chosen = parameters[this.page.rig.bar];
    const [per, si] = phrases ? [chosen.factor, chosen.unit] : area === null ? [1, "Pa/m"] : [area, "N/m"];
    if (answer.intervals === null || (phrases && !(own > 0))) {
      this.bar.hidden = true;
      put(this.bar, "aria-label", "it does not enter linearly here");
      return;
    }
    const intervals = answer.intervals.map(({ low, high }) => ({ low: low + gain, high: high + gain }));
    const ends = answer.intervals.flatMap(({ low, high }) => [low, high]).filter((k) => k > 0 && Number.isFinite(k)).map((k) => k + gain);
    const marks = [...ends, own, gain].filter((k) => k > 0);
    if (!marks.length || answer.status === ABSENT) {
      this.bar.hidden = true;
      this.bar.setAttribute("aria-label", "no stiffness is stable");
      return;
    }
    this.bar.hidden = false;
    const most = Math.max(...marks), [factor, name] = display(own * per, si), one = most < ASUNDER * Math.min(...marks);
    const stiffness = (k) => (one ? `${digits((k * per) / factor)} ${name.replace("^2", "²")}`.trim() : shown(k * per, si)); // one unit on one bar, unless decades lie between
    const low = Math.log(Math.min(...marks)) - DECADE, high = Math.log(Math.max(...marks)) + DECADE;
    const x = (k) => 100 * Math.min(1, Math.max(0, k > 0 ? (Math.log(k) - low) / (high - low) : 0));
    const least = gain > 0 ? `M0 0H${x(gain)}V10H0Z` : ""; // less than the gain alone is not to be had
    const drawn = `M0 0H100V10H0Z|${least}|${intervals.map((one) => `M${x(one.low)} 0H${x(one.high)}V10H${x(one.low)}Z`).join("")}`.split("|");
    this.paths.forEach((path, n) => put(path, "d", drawn[n]));
    const within = (k) => Math.min(80, Math.max(20, x(k))), begins = new Set(intervals.map((one) => one.low));
    const scale = ticks(Math.exp(low) * per, Math.exp(high) * per, true, 4).map((k) => k / per).filter((k) => x(k) > 6 && x(k) < 94);
    const marked = [...scale.map((k) => ["tick", x(k), ""]), ["own", x(own), ""], ...ends.map((k) => ["edge", x(k), ""])];
    const labels = [...scale.map((k) => ["tick", x(k), stiffness(k)]), ["now", within(own), `${phrases ? "" : gain > 0 ? "gain" : "stiffness"}${gain > 0 && own > gain ? " and stiffness" : ""} now ${stiffness(own)}`.trim()],
      ...(own > gain && gain > 0 && !ends.length ? [["", within(gain), `the gain alone ${stiffness(gain)}`]] : []),
      ...ends.map((k) => ["", within(k), `${begins.has(k) ? "stable from" : "to"} ${stiffness(k)}`])];
    placed(this.marks, marked, "i");
    placed(this.labels, labels, "span");
    const words = intervals.map(({ low: a, high: b }) => (b < Infinity ? `${stiffness(a)} to ${stiffness(b)}` : a > gain ? `above ${stiffness(a)}` : "any"));
    const what = phrases ? `values of ${chosen.name}` : gain > 0 ? `stiffness and gain together, of which the gain is ${stiffness(gain)}` : "stiffness";
    put(this.bar, "aria-label", `stable ${what}: ${words.join(", or ") || "none"}`);
  }
}
