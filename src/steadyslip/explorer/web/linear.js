// What a rig's linear equations say at given parameters: steady sliding, verdict, stable stiffness, eigenvalues.
// The equations themselves are generated (steadyslip/explorer/equations.py).
import { dampingOfPairs, roots } from "./polynomials.js";

/** @typedef {import("./polynomials.js").Complex} Complex */
/** @typedef {{low: number, high: number}} Interval */
/** @typedef {Record<string, (R: Float64Array, x: number, y: Float64Array) => void>} Programs */
/** @typedef {{parameters: string[], affine: boolean, degree: number, squares: number, closed: boolean, edge: number, grid: [number, number, number], solved: number,
 *   observed: [string, string, string][]}} Facts */

const NEARLY_REAL = 1e-6, SAME = 1e-9; // imaginary part of a root that is tried as real; two edges that are one
export const ABSENT = 0, STABLE = 1, UNSTABLE = 2, UNKNOWN = 3;

export class Linear {
  /**
   * @param {Programs} programs
   * @param {Facts} facts
   */
  constructor(programs, facts) {
    this.programs = programs;
    this.facts = facts;
    this.count = facts.parameters.length;
    this.R = new Float64Array(this.count + 1);
    this.y = new Float64Array(Math.max(8, 2 * facts.degree + 4, facts.squares + 2, facts.observed.length));
    this.c = new Float64Array(facts.degree + 3); // whether all roots are on the left, and it is ill-posed, behind coefficients
  }

  /** What a program gives. @param {string} name @param {number} many @param {number} [number] @param {Float64Array} [from] */
  ask(name, many, number = 0, from = this.R) {
    this.programs[name](from, number, this.y);
    return Array.from(this.y.subarray(0, many));
  }

  /** Parameters in the Model's order. @param {ArrayLike<number>} values */
  set(values) {
    this.R.set(values);
    return this;
  }

  /** All steady normal stresses, rising; and whether numbers left the range of floating point. */
  stresses() {
    if (!this.facts.affine) return { found: this.searched(), lost: false, slope: NaN, load: NaN };
    const [sigma, slope, load] = this.ask("steady", 3);
    return { found: sigma > 0 ? [sigma] : [], lost: !Number.isFinite(slope) || !Number.isFinite(load), slope, load };
  }

  /** Roots of the balance over the grid of stresses, each bracketed by a change of sign. */
  searched() {
    const { grid: [many, first, last], solved } = this.facts, found = [], at = (sigma) => {
      this.R[this.count] = sigma;
      this.programs.residual(this.R, 0, this.y);
      return this.y[0];
    };
    let low = 10 ** first, below = at(low);
    for (let i = 1; i < many; i++) {
      const high = 10 ** (first + ((last - first) * i) / (many - 1)), above = at(high);
      if (above === 0) found.push(high);
      else if (below * above < 0) {
        const root = bracketed(at, low, high, below);
        if (Math.abs(at(root)) <= solved * root) found.push(root); // a pole changes sign too
      }
      [low, below] = [high, above];
    }
    return found;
  }

  /** ABSENT, STABLE, UNSTABLE (ill-posed too) or UNKNOWN: what charts and tracks are painted with, so it makes no arrays. */
  status(branch = 0) {
    const { R, c, y, programs } = this;
    programs.allowed(R, 0, y);
    if (y[0] !== 1) return UNKNOWN;
    let sigma = NaN;
    if (this.facts.affine) {
      programs.steady(R, 0, y);
      if (!Number.isFinite(y[1]) || !Number.isFinite(y[2])) return UNKNOWN;
      if (branch === 0) sigma = y[0];
    } else sigma = this.searched()[branch];
    if (!(sigma > 0)) return ABSENT;
    R[this.count] = sigma;
    programs.coefficients(R, 0, c);
    const { degree } = this.facts;
    for (let i = 0; i <= degree; i++) if (!Number.isFinite(c[i])) return UNKNOWN;
    return c[degree + 1] === 1 ? STABLE : UNSTABLE;
  }

  /** The whole answer at the parameters that are set. */
  assess(branch = 0) {
    const status = this.status(branch), { found, slope, load } = this.stresses();
    const answer = { status, sigma: found.length > branch ? found[branch] : NaN, states: found.length, slope, load };
    if (status === ABSENT || status === UNKNOWN) return { ...answer, ...NOTHING };
    this.R[this.count] = answer.sigma;
    const degree = this.facts.degree, c = this.ask("coefficients", degree + 3), illPosed = c.splice(degree + 1)[1] === 1;
    const eigenvalues = roots(c), both = this.ask("split", 2 * degree + 2);
    const p = both.slice(0, degree + 1), q = both.slice(degree + 1), own = this.R[this.facts.parameters.indexOf("slider.stiffness")];
    const { intervals, ends } = this.stableStiffness(p, q), [statics] = this.ask("statics", 1);
    const critical = ends.length ? ends.reduce((a, b) => (Math.abs(b - own) < Math.abs(a - own) ? b : a)) : null;
    const [share, gain] = this.ask("stiffness", 2);
    const at = critical === null ? [] : roots(p.map((v, i) => v + critical * q[i]));
    const swing = at.filter((s) => s.im > 0).sort((a, b) => Math.abs(a.re) / a.im - Math.abs(b.re) / b.im)[0];
    const edgewise = swing && Math.abs(swing.re) < 1e-6 * swing.im ? swing.im : 0;
    const observed = this.ask("observables", this.facts.observed.length);
    return {
      ...answer, eigenvalues, intervals, ends, p, q, critical, share, gain, stiffness: own,
      illPosed,
      side: critical === null ? null : intervals.some((one) => one.low === critical) ? "above" : "below",
      frequency: critical === null ? null : edgewise,
      onEdge: !illPosed && this.edgeDecides(eigenvalues, statics <= this.facts.edge),
      observed: Object.fromEntries(this.facts.observed.map(([name], i) => [name, observed[i]])),
    };
  }

  /** Whether a root on the axis decides: no other grows. @param {Complex[]} found @param {boolean} neutral whether one is zero */
  edgeDecides(found, neutral) {
    const { edge } = this.facts, least = Math.min(...found.map((s) => Math.hypot(s.re, s.im)));
    const grows = found.some(({ re, im }) => re > edge * Math.hypot(re, im) && !(neutral && Math.hypot(re, im) <= least));
    return (neutral || Math.abs(0.5 * dampingOfPairs(found)) <= edge) && !grows;
  }

  /** Stable k > 0, and the ends where stability changes; the closed form where there is one, which keeps its digits. */
  stableStiffness(p, q) {
    if (!this.facts.closed) return this.stableSet(p, q);
    const [low, high] = this.ask("interval", 2), intervals = low < high ? [{ low, high }] : [];
    const ends = intervals.flatMap(({ low, high }) => [low, high]).filter((k) => k > 0 && Number.isFinite(k));
    return { intervals, ends };
  }

  /** The same by trial: between all k at which a root may cross the axis, the verdict is one. */
  stableSet(p, q) {
    const both = Float64Array.of(...p, ...q), [still, infinite, ...squares] = this.ask("edges", this.facts.squares + 2, 0, both), cuts = [still, infinite];
    for (const { re, im } of roots(squares)) if (re > 0 && Math.abs(im) <= NEARLY_REAL * Math.hypot(re, im)) cuts.push(this.ask("onAxis", 1, re, both)[0]);
    const found = cuts.filter((k) => k > 0 && Number.isFinite(k)).sort((a, b) => a - b);
    const apart = [0, ...found.filter((k, i) => i === 0 || k > found[i - 1] * (1 + SAME)), Infinity];
    const ratios = p.map((v, i) => Math.abs(v / q[i])).filter((r) => r > 0 && Number.isFinite(r)), natural = ratios.length ? Math.max(...ratios) : 1;
    const intervals = [], ends = [];
    let before = false;
    for (let i = 0; i + 1 < apart.length; i++) {
      const low = apart[i], high = apart[i + 1], inner = low > 0 ? Math.sqrt(low) * Math.sqrt(high) : high / 2, last = low > 0 ? 2 * low : natural;
      const stable = this.ask("stableAt", 1, high === Infinity ? last : inner, both)[0] === 1;
      if (i > 0 && stable !== before) ends.push(low);
      if (stable && before) intervals[intervals.length - 1].high = high;
      else if (stable) intervals.push({ low, high });
      before = stable;
    }
    return { intervals, ends };
  }
}

const NOTHING = {
  eigenvalues: /** @type {Complex[]} */ ([]), intervals: /** @type {Interval[]} */ ([]), ends: [], p: [], q: [], critical: null, side: null,
  frequency: null, share: NaN, gain: NaN, stiffness: NaN, illPosed: false, onEdge: false,
  observed: /** @type {Record<string, number>} */ ({}),
};

/** A root between two values of different sign: regula falsi (Illinois), then bisection while it does not narrow. */
function bracketed(at, low, high, below) {
  let above = at(high), side = 0;
  for (let i = 0; i < 200 && high - low > 1e-15 * low; i++) {
    let middle = i < 100 ? high - (above * (high - low)) / (above - below) : 0.5 * (low + high);
    if (!(middle > low && middle < high)) middle = 0.5 * (low + high);
    if (middle === low || middle === high) break;
    const value = at(middle);
    if (value === 0) return middle;
    if (value > 0 === below > 0) {
      [low, below] = [middle, value];
      if (side === 1) above *= 0.5;
      side = 1;
    } else {
      [high, above] = [middle, value];
      if (side === -1) below *= 0.5;
      side = -1;
    }
  }
  return Math.abs(at(low)) < Math.abs(at(high)) ? low : high;
}
