// The verdict: a sentence, why, and a bar of the stable stiffnesses.
import { make, svg, tell } from "./dom.js";
import { ABSENT } from "./linear.js";
import { ticks } from "./plot.js";
import { headline, kindOf, quantity, reason } from "./words.js";

export class Banner {
  /** @param {any} data @param {string[]} differs what this browser computes otherwise than Python did */
  constructor(data, differs) {
    this.data = data;
    this.sentence = make("h1", {});
    this.reason = make("p", {});
    this.bar = make("div", { className: "bar", role: "img" });
    this.notice = make("p", { className: "notice", role: "status" });
    if (differs.length) this.notice.textContent = `This browser computes otherwise than Python did (${differs.slice(0, 3).join("; ")}): do not rely on this page.`;
    this.box = make("section", { className: "verdict", "aria-label": "verdict" }, make("div", { "aria-live": "polite" }, this.sentence, this.reason), this.bar, this.notice);
  }

  show(answer, drive) {
    this.box.dataset.kind = kindOf(answer);
    tell(this.sentence, headline(answer, drive));
    tell(this.reason, reason(answer, this.data));
    this.showBar(answer);
  }

  /** The stable stiffnesses, controller's gain included, on a logarithmic bar, with the rig's own. */
  showBar(answer) {
    const { gain } = answer, own = answer.stiffness + gain; // a controller's gain counts as the sentence counts it
    const stiffness = (k) => quantity(k, "Pa/m", this.data.area);
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
    const within = (place) => `left: ${Math.min(80, Math.max(20, place))}%`, at = (k, name) => make("i", { className: name, style: `left: ${x(k)}%` });
    const begins = new Set(intervals.map((one) => one.low)), labels = ends.map((k) => make("span", { textContent: `${begins.has(k) ? "stable from" : "to"} ${stiffness(k)}`, style: within(x(k)) }));
    const now = make("span", { className: "now", textContent: `stiffness now ${stiffness(own)}`, style: within(x(own)) });
    const per = this.data.area ?? 1, scale = ticks(Math.exp(low) * per, Math.exp(high) * per, true, 4).filter((k) => x(k / per) > 6 && x(k / per) < 94);
    const ruled = scale.flatMap((k) => [at(k / per, "tick"), make("span", { className: "tick", textContent: stiffness(k / per), style: `left: ${x(k / per)}%` })]);
    this.bar.replaceChildren(drawing, ...ruled, at(own, "own"), ...ends.map((k) => at(k, "edge")), now, ...labels);
    const words = intervals.map(({ low: a, high: b }) => (b === Infinity ? `above ${stiffness(a)}` : `${stiffness(a)} to ${stiffness(b)}`));
    this.bar.setAttribute("aria-label", `stable stiffness: ${words.join(", or ") || "none"}`);
  }
}
