// Eigenvalues in the complex plane, and how they move with the stiffness.
import { svg } from "./dom.js";
import { axis, straight } from "./plot.js";
import { roots } from "./polynomials.js";

const POINTS = 90, DECADES = 2, VIEW = 2.2; // half the width of the view, in sizes of the eigenvalues that decide
const SIZES = [1.8, 2.6, 3.4, 4.2]; // of dots, as the stiffness rises
const BOX = { left: 62, top: 8, width: 290, height: 220 };

/** Stiffnesses around those that matter, or none where there is nothing to start from. */
function stiffnesses(answer) {
  const known = [answer.stiffness, ...answer.ends].filter((k) => k > 0);
  if (!known.length) return [];
  const low = Math.log10(Math.min(...known)) - DECADES, high = Math.log10(Math.max(...known)) + DECADES;
  return Array.from({ length: POINTS }, (_, i) => 10 ** (low + ((high - low) * i) / (POINTS - 1)));
}

export class Locus {
  constructor() {
    this.canvas = svg("svg", { class: "chart locus", role: "img", viewBox: `0 0 ${BOX.left + BOX.width + 14} ${BOX.top + BOX.height + 46}` });
  }

  /** @param {any} answer */
  show(answer) {
    const { eigenvalues, p, q } = answer;
    this.canvas.replaceChildren();
    this.canvas.style.display = eigenvalues.length ? "" : "none";
    if (!eigenvalues.length) return;
    const at = (k) => roots(p.map((v, i) => v + k * q[i])), sizes = [eigenvalues[0], ...answer.ends.map((k) => at(k)[0])].map((s) => Math.hypot(s.re, s.im));
    const half = VIEW * Math.max(...sizes.filter(Number.isFinite), Number.MIN_VALUE);
    const across = straight(-half, half), ratio = BOX.height / BOX.width, up = straight(-half * ratio * 1.3, half * ratio * 1.3);
    const x = (s) => BOX.left + across.of(s.re) * BOX.width, y = (s) => BOX.top + (1 - up.of(s.im)) * BOX.height;
    const shows = (s) => across.of(s.re) >= 0 && across.of(s.re) <= 1 && up.of(s.im) >= 0 && up.of(s.im) <= 1;
    this.canvas.append(
      svg("rect", { class: "stable left", x: BOX.left, y: BOX.top, width: BOX.width / 2, height: BOX.height }),
      axis(BOX, across, [-half, half], 1, "1/s", "growth rate", false), axis(BOX, up, [up.at(0), up.at(1)], 1, "rad/s", "frequency", true),
      svg("line", { class: "zero", x1: BOX.left + BOX.width / 2, x2: BOX.left + BOX.width / 2, y1: BOX.top, y2: BOX.top + BOX.height }),
      svg("rect", { x: BOX.left, y: BOX.top, width: BOX.width, height: BOX.height, class: "frame" }));
    const dots = SIZES.map(() => "");
    stiffnesses(answer).forEach((k, n) => {
      for (const s of at(k)) if (shows(s)) dots[Math.floor((n * SIZES.length) / POINTS)] += `M${x(s).toFixed(1)} ${y(s).toFixed(1)}h0`;
    });
    this.canvas.append(...dots.map((d, n) => svg("path", { class: "dot", d, "stroke-width": SIZES[n] })));
    for (const k of answer.ends) {
      for (const s of at(k)) if (shows(s)) this.canvas.append(svg("path", { class: "crossing", d: `M${x(s) - 5} ${y(s)}l5 -5l5 5l-5 5z` }));
    }
    const outside = eigenvalues.filter((s) => !shows(s)).length;
    for (const s of eigenvalues) if (shows(s)) this.canvas.append(svg("path", { class: `own ${s.re > 0 ? "grows" : ""}`, d: `M${x(s) - 5} ${y(s) - 5}l10 10m0 -10l-10 10` }));
    this.canvas.setAttribute("aria-label", `eigenvalues in the complex plane, ${eigenvalues.length - outside} of ${eigenvalues.length} in view; dots: as the stiffness rises`);
  }
}
