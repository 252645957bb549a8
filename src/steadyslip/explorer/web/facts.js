// Tables of steady sliding and eigenvalues, root locus, and list of nearest edges.
import { make, put, svg, tell } from "./dom.js";
import { lettered } from "./controls.js";
import { BESIDE } from "./edges.js";
import { ABSENT, UNKNOWN } from "./linear.js";
import { Locus } from "./locus.js";
import { fill, words } from "./modes.js";
import { apart, digits, shown, told } from "./quantities.js";
import { inside } from "./rig.js";
import { NEXT_TO_IT, edgeWords, named, quantity } from "./words.js";

/** Legend of the root locus: meaning, path and class of each mark. */
const MARKS = [
  ["M1 12h12l-6 -11z", "own grows", "now, grows"], ["M2 2l10 10m0 -10l-10 10", "own", "now, does not grow"],
  ["M2 7l5 -5l5 5l-5 5z", "crossing", "at the edge of stability"],
];
const DOTS = "M2 7h0", LARGER = "M11 7h0";

/** Update the rows of a list: new elements only if their number changes, otherwise new text. */
function rewrite(list, rows, row, many) {
  if (list.children.length !== many * rows.length) list.replaceChildren(...rows.flatMap(row));
  rows.forEach((words, n) => words.forEach((text, k) => tell(many === 1 ? list.children[n].children[k] : list.children[many * n + k], text)));
}

function legend() {
  const key = (words, ...drawn) => make("span", {}, svg("svg", { class: "locus", viewBox: "0 0 14 14", "aria-hidden": "true" }, ...drawn), words);
  const dots = [svg("path", { class: "dot", d: DOTS, "stroke-width": 1.8 }), svg("path", { class: "dot", d: LARGER, "stroke-width": 4.2 })];
  return make("p", { className: "key" }, ...MARKS.map(([d, name, words]) => key(words, svg("path", { d, class: name }))), key("at other values of what the bar shows, the larger the higher", ...dots));
}

/** Text of the distance to an edge: per cent, a factor, degrees, or words. */
function change(one, value, at) {
  const sign = at < value ? "" : "+", ratio = at / value, few = (share) => `${sign}${digits(share, 3)}`;
  if (one.unit === "rad") return `${few(((at - value) * one.factor * 180) / Math.PI)}\u00a0deg`;
  if (!value) return "from zero";
  if (Math.abs(ratio - 1) <= NEXT_TO_IT) return "0";
  if (ratio < -10) return "to the other sign";
  return (ratio > 0 && ratio < 0.1) || ratio > 10 ? `×\u00a0${digits(ratio, 3)}` : `${few(100 * (at - value) / Math.abs(value))}\u00a0%`;
}

export class Facts {
  /** @param {import("./page.js").Page} page */
  constructor(page) {
    this.page = page;
    this.steady = make("dl", {});
    this.eigenvalues = make("tbody", {});
    this.locus = new Locus();
    this.near = make("ol", { className: "edges" });
    this.far = make("details", {}, make("summary", {}), make("ol", { className: "edges" }));
    const head = make("thead", {}, make("tr", {}, ...page.rig.data.columns.map((text) => make("th", { textContent: text, scope: "col" }))));
    this.box = make("section", { className: "facts", "aria-label": "details", tabIndex: -1 },
      make("div", {}, make("h2", { textContent: "Nearest edges" }), make("p", { className: "hint" }, "one parameter changed, the others as they are", make("span", { className: "press", textContent: `; press to go ${100 * BESIDE} % to its stable side, or to the one that slides steadily` })), this.near, this.far),
      this.sliding = make("div", {}, make("h2", { textContent: "Steady sliding" }), this.steady),
      this.swings = make("div", {}, make("h2", { textContent: "Eigenvalues" }), make("p", { className: "hint", textContent: "what becomes of a small disturbance; steady sliding is stable if it dies out in each way" }), make("table", {}, head, this.eigenvalues), this.locus.canvas, this.locus.note,
        this.shape = make("p", { className: "mode" }), legend()));
  }

  /** Update the numbers. @param {any} answer */
  show(answer) {
    const { rig } = this.page, { area, phrases, aperiodic } = rig.data, absent = answer.status === ABSENT || answer.status === UNKNOWN;
    this.sliding.hidden = this.swings.hidden = absent;
    tell(this.shape, answer.mode ? `In the leading mode ${words(answer.mode, rig.data.facts.shape)}.` : "");
    const facts = [...(phrases ? [] : [["normal stress", answer.sigma, "Pa", ""]]), ...rig.data.facts.observed.map(([name, unit, meaning]) => [name.replace(/^links\./, "").replace(/\.(?=\w+$)/, ": ").replace(/: v$/, ": velocity v").replace(/_/g, " "), answer.observed[name], unit, meaning])];
    rewrite(this.steady, absent ? [] : facts.map(([name, value, unit, meaning]) => [(named(name, area && unit === "Pa" ? "N" : unit) + (meaning && `: ${meaning}`)).replace(/Theta/g, "Θ").replace(/theta/g, "θ").replace(/sigma.e\b/g, "σₑ").replace(/_(\d)|(?<=Θ|θ) (\d)/gi, (_, a, b) => "₀₁₂₃₄₅₆₇₈₉"[a ?? b]), quantity(value, unit, area)]),
      () => [make("dt", {}), make("dd", {})], 2);
    const modes = answer.eigenvalues.filter((s) => s.im >= 0);
    rewrite(this.eigenvalues, modes.map((s) => {
      const time = shown(Math.LN2 / Math.abs(s.re), "s");
      const row = [`${digits(s.re)} 1/s`, s.im > 0 ? shown((2 * Math.PI) / s.im, "s") : aperiodic, fill(rig.data.pace[s.re > 0 ? "grows" : s.re < 0 ? "decays" : "stays"], { time })];
      return row.map((text) => text.replace(/ (?=\S+$)/, "\u00a0")); // no line break between number and unit
    }), () => [make("tr", {}, make("td", {}), make("td", {}), make("td", {}))], 1);
    modes.forEach((s, n) => put(this.eigenvalues.children[n], "class", s.re > 0 ? "grows" : ""));
    const linear = answer.intervals && (rig.data.phrases || rig.data.parameters[rig.bar]?.name === rig.data.stiffness);
    this.locus.show(answer, linear || !this.page.tracks ? undefined : this.page.others());
  }

  /** Update the list of nearest edges from the tracks. */
  showEdges() {
    const { page } = this;
    const rows = (edges) => edges.map((edge) => {
      const one = page.rig.data.parameters[edge.i], go = make("button", { type: "button", "data-name": one.name }, ...lettered(one), ` → ${told(one, edge.at, apart(page.rig.values[edge.i], edge.at)).replace(/ /g, "\u00a0")}`);
      go.addEventListener("click", () => {
        if (inside(one, edge.landing)) page.put(page.with(edge.i, edge.landing));
      });
      const moved = (at) => change(one, page.rig.values[edge.i], at), other = edge.other === undefined ? "" : `; the other edge: ${told(one, edge.other)}, ${moved(edge.other)}`;
      return make("li", {}, go, ` ${moved(edge.at)}: ${edgeWords(edge, page)}${other}`);
    });
    const found = page.edges(), far = found.filter((edge) => edge.far);
    const near = found.filter((edge) => !edge.far), [next] = near, one = next && page.rig.data.parameters[next.i];
    this.near.replaceChildren(...rows(near));
    tell(page.next, one ? `edge: ${one.title} → ${told(one, next.at, apart(page.rig.values[next.i], next.at))}, ${change(one, page.rig.values[next.i], next.at)}` : "");
    this.far.hidden = !far.length;
    if (far.length === found.length) this.far.open = true;
    tell(this.far.firstChild, `${far.length} ${fill(page.rig.data.beyond.far, page.rig.data)}`);
    this.far.lastChild.replaceChildren(...rows(far));
  }
}
