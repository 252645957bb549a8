// Linear stability of a rig at given parameters: steady sliding, verdict, stable stiffness, eigenvalues.
// The equations themselves are generated (steadyslip/explorer/equations.py).
import { modeOf } from "./modes.js";
import { about } from "./nearness.js";
import { isEven, roots } from "./polynomials.js";

/** @typedef {import("./polynomials.js").Complex} Complex */
/** @typedef {{low: number, high: number}} Interval */
/** @typedef {Record<string, (R: Float64Array, x: number, y: Float64Array) => void>} Programs */
/** @typedef {{parameters: string[], contacts: string[], searched: boolean[], joint: boolean, couples: boolean, degree: number, squares: number, closed: boolean, gain?: string | null, edge: number, grid: [number, number, number], solved: number,
 *   observed: [string, string, string][], coordinates?: string[], matrix?: any, stores?: any, shape?: any}} Facts */

const NEARLY_REAL = 1e-6; // imaginary part over |s| of a root below which it is also tried as real
export const SAME = 1e-9; // relative distance below which two edges count as one
const HUGE = 1e150, SIGNED = 1e4; // HUGE: sizes whose products do not overflow; SIGNED: above the logarithm of any product of coefficients
const FORMULA = 5, REAL = 1e-9; // FORMULA: values of `steady` for each contact; REAL: relative imaginary part of a gain that is rounding
const APART = [1e-6, 1, 1e6]; // factors on a parameter for the test that it enters linearly
const SIZED_APART = 1e12; // ratio of an edge to the size of a parameter above which the edge is rounding of 0 or infinity
/** Names of the statuses, as in the style sheet and in what Python sends of each. */
export const CLASSES = ["none", "stable", "unstable", "unknown", "undamped"];
export const ABSENT = 0, STABLE = 1, UNSTABLE = 2, UNKNOWN = 3, UNDAMPED = 4; // as in steadyslip/linear/status.py

/** True if no disturbance grows. @param {number} status */
export const isQuiet = (status) => status === STABLE || status === UNDAMPED;

export class Linear {
  bar = -1; // index of the parameter on the bar of a machine

  /**
   * @param {Programs} programs
   * @param {Facts} facts
   */
  constructor(programs, facts) {
    this.programs = programs;
    this.facts = facts;
    this.count = facts.parameters.length;
    this.mixed = facts.searched.some(Boolean) && !facts.searched.every(Boolean);
    const contacts = facts.contacts.length, many = facts.degree + 1;
    this.many = 3 + (facts.joint ? 1 + contacts : facts.searched.some(Boolean) ? 0 : 2 * contacts); // number of values of `functions`
    this.R = new Float64Array(this.count + contacts);
    this.y = new Float64Array(Math.max(8, 2 * many + 4, facts.squares + 2, facts.observed.length, FORMULA * contacts, ...(facts.matrix ? [facts.matrix[1].length, 2 + contacts + facts.stores.length * 4 + 2 * many] : [])));
    this.c = new Float64Array(2 * facts.degree + 4); // coefficients, 1 if stable, 1 if ill-posed, then functions that change sign with the status
  }

  /** Values of a program. @param {string} name @param {number} many @param {Float64Array} [from] @param {number} [number] */
  ask(name, many, from = this.R, number = 0) {
    this.programs[name](from, number, this.y);
    return Array.from(this.y.subarray(0, many));
  }

  /** Set the parameters, in the order of the Model. @param {ArrayLike<number>} values */
  set(values) {
    this.R.set(values);
    return this;
  }

  /** Steady normal stresses of a contact: roots of its residual, bracketed by sign changes on the grid of stresses. */
  sought(contact) {
    const { grid: [many, first, last], solved } = this.facts, found = [], program = this.programs[`residual${contact}`], at = (sigma) => {
      this.R[this.count + contact] = sigma;
      program(this.R, 0, this.y);
      return this.y[0];
    };
    let low = 10 ** first, below = at(low);
    for (let i = 1; i < many; i++) {
      const high = 10 ** (first + ((last - first) * i) / (many - 1)), above = at(high);
      if (above === 0) found.push(high);
      else if (below * above < 0) {
        const root = bracketed(at, low, high, below);
        if (Math.abs(at(root)) <= solved * root) found.push(root); // otherwise it is a pole
      }
      [low, below] = [high, above];
    }
    return found;
  }

  /** Write the steady normal stresses into R; returns STABLE, or ABSENT or UNKNOWN if there are none. */
  settle(branch = 0) {
    const { R, y, count, programs, facts: { contacts, searched, joint } } = this;
    if (joint) return this.together();
    if (!searched.every(Boolean)) programs.steady(R, 0, y);
    let status = STABLE;
    const from = this.mixed ? y.slice(0, FORMULA * contacts.length) : y; // copy: the search overwrites y
    for (let i = 0; i < contacts.length; i++) {
      let sigma = NaN;
      if (searched[i]) sigma = this.sought(i)[branch];
      else {
        const at = FORMULA * i;
        if (!Number.isFinite(from[at + 1]) || !Number.isFinite(from[at + 2])) return UNKNOWN;
        if (branch === 0) sigma = from[at];
      }
      R[count + i] = sigma;
      if (!(sigma > 0)) status = ABSENT;
    }
    return status;
  }

  /** Write the steady normal stresses of contacts that press on each other into R; returns STABLE, ABSENT or UNKNOWN. */
  together() {
    const { R, y, count, programs, facts: { contacts: { length: many } } } = this;
    programs.steady(R, 0, y);
    for (let i = many; i <= 2 * many; i++) if (!Number.isFinite(y[i])) return UNKNOWN;
    let status = this.gain() < 1 ? STABLE : ABSENT;
    for (let i = 0; i < many; i++) {
      R[count + i] = y[i];
      if (!(y[i] > 0 && y[i] < Infinity)) status = ABSENT;
    }
    return status;
  }

  /** Largest real eigenvalue of the matrix with which contacts press on each other; lock-up at 1. */
  gain() {
    const many = this.facts.contacts.length;
    if (this.y.subarray(many, 2 * many).every((one) => one === 0)) return 0; // nilpotent: one contact presses on the other only
    const real = roots(this.y.subarray(many, 2 * many + 1)).filter((s) => Math.abs(s.im) <= REAL * Math.hypot(s.re, s.im));
    return real.reduce((most, s) => Math.max(most, s.re), -Infinity);
  }

  /** Status; UNSTABLE also if ill-posed. It is called for each point of a chart, so it makes no arrays where something damps. */
  status(branch = 0) {
    const { R, c, y, programs } = this;
    programs.allowed(R, 0, y);
    if (y[0] !== 1) return UNKNOWN;
    const settled = this.settle(branch);
    if (settled !== STABLE) return settled;
    programs.coefficients(R, 0, c);
    const { degree } = this.facts, top = c[degree] || c[degree - 1] || 1; // as in steadyslip/model/range.py
    for (let i = 0; i <= degree; i++) if (!Number.isFinite(c[i]) || !Number.isFinite(c[i] / top)) return UNKNOWN;
    if (c[degree + 1] === 1) return STABLE;
    return this.isUndamped() && roots(c.subarray(0, degree + 1)).every(({ re }) => re <= 0) ? UNDAMPED : UNSTABLE;
  }

  /** True if nothing damps a machine, as in steadyslip/linear/undamped.py; call `status` before. */
  isUndamped() {
    const { c, facts: { degree, couples } } = this;
    let some = false;
    for (let k = 1; k <= degree && couples; k++) {
      if (c[k] !== 0 && k % 2) return false;
      some ||= c[k] !== 0;
    }
    return some;
  }

  /**
   * Functions of which one changes sign wherever the status does; call `status` before. Each is coded as
   * sign * (ln|value| + SIGNED).
   * @param {number} status
   */
  functions(status) {
    const { y, c, facts: { contacts: { length: many }, searched, joint, degree } } = this, found = /** @type {number[]} */ ([]);
    if (status === UNKNOWN) return found;
    if (joint) {
      let left = 0; // det(1 − A), from the coefficients of the characteristic polynomial of A
      for (let i = many; i <= 2 * many; i++) left += y[i];
      found.push(signedLog(left));
      for (let i = 0; i < many; i++) found.push(signedLog(left * y[i]));
    } else if (!searched.some(Boolean)) for (let i = 0; i < many; i++) found.push(signedLog(1 - y[FORMULA * i + 1]), signedLog(y[FORMULA * i + 2]));
    if (status === ABSENT) return found;
    if (this.isUndamped()) return [...found, signedLog(c[0]), ...this.apart()];
    let product = 1, size = SIGNED;
    for (let k = degree + 5; k < 2 * degree + 4; k++) {
      product *= c[k];
      if (Math.abs(product) > HUGE || Math.abs(product) < 1 / HUGE) [product, size] = [Math.sign(product), size + Math.log(Math.abs(product))];
    }
    found.push(signedLog(c[degree + 3]), signedLog(c[degree + 4]), signedLog(product, size));
    return found;
  }

  /** Highest coefficient, and size of the discriminant in s², of a machine that nothing damps: that is zero where two roots meet. */
  apart() {
    const { c, facts: { degree } } = this, even = Array.from(c.subarray(0, degree + 1)).filter((_, k) => k % 2 === 0), u = roots(even);
    let size = SIGNED;
    u.forEach((one, n) => {
      for (const other of u.slice(n + 1)) size += 2 * Math.log(Math.hypot(one.re - other.re, one.im - other.im) / (Math.hypot(one.re, one.im) + Math.hypot(other.re, other.im)));
    });
    return [signedLog(even[even.length - 1]), Math.max(size, 0)];
  }

  /** Complete answer at the parameters that are set: status, steady sliding, stable values, eigenvalues. */
  assess(branch = 0) {
    const { facts, R, count } = this, status = this.status(branch);
    const answer = { status, sigma: R[count], sigmas: Array.from(R.subarray(count)) };
    if (status === ABSENT || status === UNKNOWN) return { ...answer, ...NOTHING, ...this.absence(status) };
    const degree = facts.degree, c = this.ask("coefficients", degree + 3), illPosed = c.splice(degree + 1)[1] === 1, eigenvalues = roots(c);
    const { p, q, own, gain, share, intervals, ends } = this.varied(c, branch), [statics] = this.ask("statics", 1);
    const held = facts.gain && !own && gain > 0 ? this.valuesOf(facts.parameters.indexOf(facts.gain), branch) : null, { critical, side } = nearestEnd(intervals, ends, own);
    const at = critical === null ? [] : roots(p.map((v, i) => v + critical * q[i]));
    const swing = at.filter((s) => s.im > 0).sort((a, b) => Math.abs(a.re) / a.im - Math.abs(b.re) / b.im)[0];
    const edgewise = swing && Math.abs(swing.re) < 1e-6 * swing.im ? swing.im : 0;
    const observed = this.ask("observables", facts.observed.length);
    return {
      ...answer, eigenvalues, intervals, ends, p, q, critical, share, gain, stiffness: own,
      illPosed, side, still: c[0],
      held: held && { ...held, ...nearestEnd(held.intervals, held.ends, gain) },
      frequency: critical === null ? null : edgewise,
      onEdge: !illPosed && this.edgeDecides(eigenvalues, statics <= facts.edge),
      observed: Object.fromEntries(facts.observed.map(([name], i) => [name, observed[i]])),
      mode: facts.shape && !illPosed && eigenvalues.length ? modeOf(this, eigenvalues[0]) : null,
    };
  }

  /**
   * What contours show, where there is steady sliding: of a slider the share k/(k + k_cr), with a controller's gain in both, 0 to 1,
   * and UPPER more where k_cr is an upper limit; else the growth rate (1/s).
   */
  strength(branch = 0) {
    const { degree } = this.facts, c = this.ask("coefficients", degree + 3), stable = c.splice(degree + 1)[0] === 1;
    if (!this.programs.split) return roots(c).reduce((most, { re }) => Math.max(most, re), -Infinity);
    const { p, q, own, gain, ...known } = this.varied(c, branch), total = own + gain;
    const { intervals, ends } = gain ? this.stableSet(p.map((v, i) => v - gain * q[i]), q) : known, { critical, side } = nearestEnd(intervals, ends, total);
    return critical === null ? Number(stable) : total / (total + critical) + (side === "below" ? UPPER : 0);
  }

  /** Eigenvalues; empty without steady sliding. */
  roots(branch = 0) {
    return this.settle(branch) === STABLE ? roots(this.ask("coefficients", this.facts.degree + 1)) : [];
  }

  /** True if the status depends on rounding. */
  onEdge(branch = 0) {
    if (this.settle(branch) !== STABLE) return false;
    const { facts: { degree, edge } } = this, c = this.ask("coefficients", degree + 3), illPosed = c.splice(degree + 1)[1] === 1;
    return !illPosed && this.edgeDecides(roots(c), this.ask("statics", 1)[0] <= edge);
  }

  /** Reason why there is no steady sliding: contact and numbers. */
  absence(status) {
    const { facts: { contacts, searched, joint }, R, y, count } = this;
    if (status === UNKNOWN) return {};
    if (joint) {
      this.programs.steady(R, 0, y);
      const gain = this.gain(), least = contacts.reduce((best, _, i) => (R[count + i] < R[count + best] ? i : best), 0);
      return { contact: least, pressing: gain, load: R[count + least] };
    }
    const i = contacts.findIndex((_, n) => !(R[count + n] > 0));
    if (searched[i]) return { contact: i, searched: true };
    const [, slope, left, load, friction] = this.ask("steady", FORMULA * contacts.length).slice(FORMULA * i);
    return { contact: i, slope, load: left, had: load, friction };
  }

  /**
   * Characteristic polynomial p + θ q, own θ and its stable intervals; θ is the stiffness of a slider, or the bar's parameter.
   * @returns {{p: number[], q: number[], own: number, share: number, gain: number, intervals: Interval[] | null, ends: number[]}}
   */
  varied(c, branch) {
    const { facts: { degree, parameters } } = this;
    if (this.programs.split) {
      const both = this.ask("split", 2 * degree + 2), p = both.slice(0, degree + 1), q = both.slice(degree + 1), [share, gain] = this.ask("stiffness", 2);
      return { p, q, share, gain, own: this.R[parameters.indexOf("slider.stiffness")], ...this.stableStiffness(p, q) };
    }
    const found = this.bar >= 0 ? this.valuesOf(this.bar, branch) : null, own = this.R[this.bar];
    return { ...(found ?? { p: c, q: c.map(() => 0), intervals: null, ends: [] }), own, share: 1, gain: 0 };
  }

  /** Stable values of a parameter that enters linearly, their ends, p and q; null for other parameters. @param {number} place */
  valuesOf(place, branch) {
    const own = this.R[place], split = own > 0 ? this.linearIn(place, branch) : null;
    if (!split) return null;
    const { intervals, ends } = resolved(this.stableSet(split.p, split.q), sizeOfFactor(split.p, split.q));
    return {
      p: split.p, q: split.q.map((v) => v / own),
      intervals: intervals.map(({ low, high }) => ({ low: low * own, high: high * own })), ends: ends.map((k) => k * own),
    };
  }

  /** p and q of the characteristic polynomial p + f q, f a factor on a parameter; null if not linear in it, or undamped. @param {number} place */
  linearIn(place, branch) {
    const { R, facts: { degree }, count } = this, many = degree + 1, told = new Float64Array(3 * many), own = R[place], sigmas = R.slice(count);
    const known = APART.every((factor, n) => {
      R[place] = own * factor;
      const there = this.settle(branch) === STABLE;
      if (there) told.set(this.ask("coefficients", many), n * many);
      return there;
    });
    R[place] = own;
    R.set(sigmas, count);
    if (!known || !told.every(Number.isFinite)) return null;
    const p = [], q = [];
    for (let k = 0; k < many; k++) {
      const [rest, slope, straight] = this.ask("linear", 3, Float64Array.of(told[k], told[many + k], told[2 * many + k]));
      if (straight !== 1) return null;
      p.push(rest);
      q.push(slope);
    }
    const undamped = this.facts.couples && isEven(p) && isEven(q); // with roots on the axis at all values
    return q.some((slope) => slope !== 0) && !undamped ? { p, q } : null;
  }

  /** Positive factors on a parameter, rising, with a root on the imaginary axis; null if it does not enter linearly. @param {number} place */
  crossings(place, branch) {
    const split = this.R[place] > 0 ? this.linearIn(place, branch) : null;
    return split && this.cuts(split.p, split.q);
  }

  /** True if a root on the axis decides stability, because no other root grows. @param {Complex[]} found @param {boolean} neutral true if one root is zero */
  edgeDecides(found, neutral) {
    const { edge } = this.facts, sizes = found.map((s) => Math.hypot(s.re, s.im)), least = Math.min(...sizes), some = sizes.filter((one) => one > 0);
    const mean = Math.exp(some.reduce((sum, one) => sum + Math.log(one), 0) / Math.max(some.length, 1));
    const onAxis = (i) => edge * Math.min(sizes[i], mean), grows = found.some(({ re }, i) => re > onAxis(i) && !(neutral && sizes[i] <= least));
    return (neutral || found.some(({ re, im }, i) => im && Math.abs(re) <= onAxis(i))) && !grows;
  }

  /** Stable intervals of k > 0 and their ends; in closed form where there is one, which loses no digits. */
  stableStiffness(p, q) {
    if (!this.facts.closed) return this.stableSet(p, q);
    const [low, high] = this.ask("interval", 2), intervals = low < high ? [{ low, high }] : [];
    const ends = intervals.flatMap(({ low, high }) => [low, high]).filter((k) => k > 0 && Number.isFinite(k));
    return { intervals, ends };
  }

  /** All k > 0, rising, at which a root of p + k q may be on the imaginary axis. */
  cuts(p, q) {
    const both = Float64Array.of(...p, ...q), [still, infinite, ...squares] = this.ask("edges", this.facts.squares + 2, both), cuts = [still, infinite];
    for (const { re, im } of roots(squares)) if (re > 0 && Math.abs(im) <= NEARLY_REAL * Math.hypot(re, im)) cuts.push(this.ask("onAxis", 1, both, re)[0]);
    const found = cuts.filter((k) => k > 0 && Number.isFinite(k)).sort((a, b) => a - b);
    return found.filter((k, i) => i === 0 || k > found[i - 1] * (1 + SAME));
  }

  /** Stable intervals of k > 0 without closed form: between the k of possible crossings the verdict is constant. */
  stableSet(p, q) {
    const both = Float64Array.of(...p, ...q), apart = [0, ...this.cuts(p, q), Infinity];
    const ratios = p.map((v, i) => Math.abs(v / q[i])).filter((r) => r > 0 && Number.isFinite(r)), natural = ratios.length ? Math.max(...ratios) : 1;
    const intervals = [], ends = [];
    let before = false;
    for (let i = 0; i + 1 < apart.length; i++) {
      const low = apart[i], high = apart[i + 1], inner = low > 0 ? Math.sqrt(low) * Math.sqrt(high) : high / 2, last = low > 0 ? 2 * low : natural;
      const stable = this.ask("stableAt", 1, both, high === Infinity ? last : inner)[0] === 1;
      if (i > 0 && stable !== before) ends.push(low);
      if (stable && before) intervals[intervals.length - 1].high = high;
      else if (stable) intervals.push({ low, high });
      before = stable;
    }
    return { intervals, ends };
  }
}

export const UPPER = 2;
const NOTHING = {
  eigenvalues: /** @type {Complex[]} */ ([]), intervals: /** @type {Interval[]} */ ([]), ends: [], p: [], q: [], critical: null, side: null,
  frequency: null, share: NaN, gain: NaN, stiffness: NaN, illPosed: false, still: NaN, onEdge: false, held: null,
  observed: /** @type {Record<string, number>} */ ({}),
};

/** Size of k in p + k q: 1 (its own value), or that at which p and k q have equal size if it is far from 1. @param {number[]} p @param {number[]} q */
function sizeOfFactor(p, q) {
  const ratios = p.map((v, i) => Math.log(Math.abs(v)) - Math.log(Math.abs(q[i]))).filter(Number.isFinite);
  const alike = Math.exp(ratios.reduce((a, b) => a + b, 0) / Math.max(ratios.length, 1));
  return alike < APART[0] || alike > APART[2] ? alike : 1;
}

/** Stable set with ends that are rounding of 0 or infinity replaced by these. @param {{intervals: Interval[], ends: number[]}} found @param {number} size */
function resolved({ intervals, ends }, size) {
  const end = (k) => (k < size / SIZED_APART ? 0 : k > size * SIZED_APART ? Infinity : k);
  const known = intervals.map(({ low, high }) => ({ low: end(low), high: end(high) })).filter(({ low, high }) => low < high);
  return { intervals: known, ends: ends.filter((k) => end(k) === k) };
}

/** End of a stable set nearest to a value, and its stable side. @param {Interval[] | null} intervals @param {number[]} ends */
function nearestEnd(intervals, ends, own) {
  if (!ends.length) return { critical: null, side: null };
  const [critical] = about(ends, (k) => k, own);
  return { critical, side: intervals?.some((one) => one.low === critical) ? "above" : "below" };
}

const signedLog = (value, size = SIGNED) => Math.sign(value) * (size + Math.log(Math.abs(value)));

/** Root between two points of different sign: regula falsi (Illinois), and bisection if that is slow. */
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
