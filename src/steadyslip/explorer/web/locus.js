// Root locus: eigenvalues in the complex plane as the stiffness varies.
import { make, put, svg, tell } from "./dom.js";
import { axis, straight } from "./plot.js";
import { roots } from "./polynomials.js";

const POINTS = 90, DECADES = 2, VIEW = 1.8; // POINTS: stiffnesses, over DECADES to each side; VIEW: half the width over the largest |s| at the edge
const SIZES = [1.8, 2.6, 3.4, 4.2]; // radii of dots, SVG units, by rising stiffness
const BOX = { left: 70, top: 8, width: 290, height: 220 };

/** Stiffnesses of the locus, around the critical or own one; empty if there is neither. */
function stiffnesses(answer) {
  const known = [answer.stiffness, ...answer.ends].filter((k) => k > 0);
  if (!known.length) return [];
  const low = Math.log10(Math.min(...known)) - DECADES, high = Math.log10(Math.max(...known)) + DECADES;
  return Array.from({ length: POINTS }, (_, i) => 10 ** (low + ((high - low) * i) / (POINTS - 1)));
}

/** Next larger round number, so that axes stay unchanged while eigenvalues move a little. */
function rounded(size) {
  const power = 10 ** Math.floor(Math.log10(size));
  return power * ([1, 1.5, 2, 3, 4, 5, 7].find((one) => one * power >= size) ?? 10);
}

export class Locus {
  constructor() {
    this.canvas = svg("svg", { class: "chart locus", role: "img", viewBox: `0 0 ${BOX.left + BOX.width + 14} ${BOX.top + BOX.height + 46}` });
    this.dots = SIZES.map((size) => svg("path", { class: "dot", "stroke-width": size }));
    this.crossings = svg("path", { class: "crossing" });
    this.decays = svg("path", { class: "own" });
    this.grows = svg("path", { class: "own grows" });
    this.half = 0;
    this.note = make("p", { className: "hint" });
  }

  /** @param {any} answer @param {{along: any[], beyond: any[]}} [others] eigenvalues at other values, where p + k q has none */
  show(answer, others) {
    const { eigenvalues, p, q } = answer, display = eigenvalues.length ? "" : "none";
    if (this.canvas.style.display !== display) this.canvas.style.display = display;
    if (!eigenvalues.length) return;
    const at = (k) => roots(p.map((v, i) => v + k * q[i])), beyond = others?.beyond ?? answer.ends.map(at), sizes = [eigenvalues[0], ...beyond.flatMap(([s]) => s ?? [])].map((s) => Math.hypot(s.re, s.im));
    const half = rounded(VIEW * Math.max(...sizes.filter(Number.isFinite), 1e-300));
    const across = straight(-half, half), ratio = BOX.height / BOX.width, up = straight(-half * ratio * 1.3, half * ratio * 1.3);
    this.frame(half, across, up);
    const x = (s) => BOX.left + across.of(s.re) * BOX.width, y = (s) => BOX.top + (1 - up.of(s.im)) * BOX.height;
    const shows = (s) => across.of(s.re) >= 0 && across.of(s.re) <= 1 && up.of(s.im) >= 0 && up.of(s.im) <= 1;
    const drawn = (all, mark) => all.filter(shows).map((s) => `M${x(s).toFixed(1)} ${y(s).toFixed(1)}${mark}`).join("");
    const dots = SIZES.map(() => "");
    const along = others?.along ?? stiffnesses(answer).map(at);
    along.forEach((all, n) => (dots[Math.floor((n * SIZES.length) / along.length)] += drawn(all, "h0")));
    dots.forEach((d, n) => put(this.dots[n], "d", d));
    put(this.crossings, "d", drawn(beyond.flat(), "m-5 0l5 -5l5 5l-5 5z"));
    const cross = "m-5 -5l10 10m0 -10l-10 10";
    put(this.decays, "d", drawn(eigenvalues.filter((s) => !(s.re > 0)), cross));
    put(this.grows, "d", drawn(eigenvalues.filter((s) => s.re > 0), "m-6 5h12l-6 -11z")); // told from the others without colours, too
    const seen = eigenvalues.filter(shows).length;
    tell(this.note, seen < eigenvalues.length ? `${eigenvalues.length - seen} of ${eigenvalues.length} ${eigenvalues.length - seen > 1 ? "are" : "is"} further out than the picture` : "");
    put(this.canvas, "aria-label", `eigenvalues in the complex plane, ${seen} of ${eigenvalues.length} in view; dots: as what the bar shows rises`);
  }

  frame(half, across, up) {
    if (half === this.half) return;
    this.half = half;
    this.canvas.replaceChildren(
      svg("rect", { class: "stable left", x: BOX.left, y: BOX.top, width: BOX.width / 2, height: BOX.height }),
      axis(BOX, across, [-half, half], { unit: "1/s" }, "growth rate", false), axis(BOX, up, [up.at(0), up.at(1)], { unit: "rad/s", own: ["rad/s", 1, ""] }, "frequency", true),
      svg("line", { class: "zero", x1: BOX.left + BOX.width / 2, x2: BOX.left + BOX.width / 2, y1: BOX.top, y2: BOX.top + BOX.height }),
      svg("rect", { x: BOX.left, y: BOX.top, width: BOX.width, height: BOX.height, class: "frame" }),
      svg("text", { class: "word", x: BOX.left + 8, y: BOX.top + 16, "text-anchor": "start" }, "decays"),
      svg("text", { class: "word", x: BOX.left + BOX.width - 8, y: BOX.top + 16, "text-anchor": "end" }, "grows"),
      ...this.dots, this.crossings, this.decays, this.grows);
  }
}
