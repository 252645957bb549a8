// Steady sliding in numbers, eigenvalues with their locus, and the list of nearest edges.
import { make, put, tell } from "./dom.js";
import { ABSENT, STABLE, UNKNOWN } from "./linear.js";
import { Locus } from "./locus.js";
import { digits, shown } from "./quantities.js";
import { inside } from "./rig.js";
import { quantity } from "./words.js";

const BECOMES = { [ABSENT]: "no steady sliding", [STABLE]: "becomes stable", [UNKNOWN]: "no rig" };

/** Rows of words in a list: elements are made where their number changes, and else told what is new. */
function rewrite(list, rows, row, many) {
  if (list.children.length !== many * rows.length) list.replaceChildren(...rows.flatMap(row));
  rows.forEach((words, n) => words.forEach((text, k) => tell(many === 1 ? list.children[n].children[k] : list.children[many * n + k], text)));
}

export class Facts {
  /** @param {import("./page.js").Page} page */
  constructor(page) {
    this.page = page;
    this.steady = make("dl", {});
    this.eigenvalues = make("tbody", {});
    this.locus = new Locus();
    this.near = make("ol", { className: "edges" });
    const head = make("thead", {}, make("tr", {}, ...["rate", "oscillation", "a disturbance"].map((text) => make("th", { textContent: text, scope: "col" }))));
    this.box = make("section", { className: "facts", "aria-label": "details" },
      make("div", {}, make("h2", { textContent: "Nearest edges" }), make("p", { className: "hint", textContent: "one parameter changed, the others as they are; press to go there" }), this.near),
      make("div", {}, make("h2", { textContent: "Steady sliding" }), this.steady),
      make("div", {}, make("h2", { textContent: "Eigenvalues" }), make("table", {}, head, this.eigenvalues), this.locus.canvas,
        make("p", { className: "hint", textContent: "crosses: these; dots: as the stiffness rises, from small to large; diamonds: where stability changes" })));
  }

  /** Numbers. @param {any} answer */
  show(answer) {
    const { rig } = this.page, { area } = rig.data, absent = answer.status === ABSENT || answer.status === UNKNOWN;
    const facts = [["normal stress", answer.sigma, "Pa"], ...rig.data.facts.observed.map(([name, unit]) => [name.replace(/_/g, " "), answer.observed[name], unit])];
    rewrite(this.steady, absent ? [] : facts.map(([name, value, unit]) => [area && unit === "Pa" ? name.replace("stress", "force") : name, quantity(value, unit, area)]),
      () => [make("dt", {}), make("dd", {})], 2);
    const modes = answer.eigenvalues.filter((s) => s.im >= 0);
    rewrite(this.eigenvalues, modes.map((s) => {
      const time = shown(Math.LN2 / Math.abs(s.re), "s");
      return [`${digits(s.re)} 1/s`, s.im > 0 ? `period ${shown((2 * Math.PI) / s.im, "s")}` : "none", s.re > 0 ? `doubles in ${time}` : `halves in ${time}`];
    }), () => [make("tr", {}, make("td", {}), make("td", {}), make("td", {}))], 1);
    modes.forEach((s, n) => put(this.eigenvalues.children[n], "class", s.re > 0 ? "grows" : ""));
    this.locus.show(answer);
  }

  /** The list, as the tracks are now. */
  showEdges() {
    const { page } = this;
    this.near.replaceChildren(...page.edges().map((edge) => {
      const one = page.rig.data.parameters[edge.i], go = make("button", { type: "button", textContent: `${one.name} → ${shown(edge.at * one.factor, one.unit)}` });
      go.addEventListener("click", () => {
        if (inside(one, edge.landing)) page.change(page.with(edge.i, edge.landing));
      });
      return make("li", {}, go, ` ${BECOMES[edge.beyond] ?? "unstable"}`);
    }));
  }
}
