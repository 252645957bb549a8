// Where the status changes along one parameter, as steadyslip/linear/search.py finds it: the parameter is sampled over its
// range, functions that pass through zero at every edge are followed where they dip between samples, and what enters
// linearly has its edges exactly. These functions are generated (steadyslip/explorer/equations.py, sliding.py).
import { ABSENT, SAME, UNKNOWN } from "./linear.js";
import { inside } from "./rig.js";

/** @typedef {{x: number, status: number, functions: number[], edge?: boolean}} Sample `functions` as `Linear.functions` has them */
/** @typedef {{at: number, below: number, above: number}} Edge where the status changes, and what it is on both sides */
/** @typedef {{edges: Edge[], status: number, low: number, high: number}} Found the status at `low`, where there is no edge */

const PER_DECADE = 40, FURTHEST = 1e6, LINEAR = 720; // the samples of Python
const AT_MOST = 2000; // samples where a range is absurd
const COARSE = 6, COARSER = 20; // times fewer while a hand moves a slider, or where edges follow from a formula; while or where both do, or steady sliding is searched for
const BEND = 1; // of the logarithm of a function over three samples: two zeros between them leave 2 ln 3 at least, powers hardly any
const DIPS = 16, PIECES = 8, DEEP = 14; // dips that are looked into; pieces of a bracket; times that it is cut, a quarter of it left
const BESIDE_EDGE = 24, PER_TEN = 4; // samples beside an edge, even in the logarithm of the distance
const EXACT = 1e-13, SEEN = 1e-5; // to which an edge is narrowed, and while a hand moves a slider
const ROUNDED = 1e-12, END = 1e-9; // shares of a value that is zero but for rounding, and of the lowest sample that is the end of a domain

/**
 * All changes of the status along a parameter, the others as they are.
 * @param {import("./rig.js").Rig} rig @param {number} i
 * @param {[number, number]} [range] that is searched beside that of Python
 * @param {boolean} [coarse] whether fewer samples will do
 * @returns {Found}
 */
export function changes(rig, i, range, coarse = false) {
  return new Search(rig, i, coarse).found(range);
}

class Search {
  constructor(rig, i, coarse) {
    this.rig = rig;
    this.i = i;
    this.coarse = coarse;
    this.one = rig.data.parameters[i];
    const exact = rig.crossings(i), slow = rig.data.facts.searched.some(Boolean);
    this.exact = exact ?? [];
    this.fewer = slow || (exact && coarse) ? COARSER : exact || coarse ? COARSE : 1;
  }

  /** @param {number} x @returns {Sample} */
  sample(x) {
    const status = this.rig.status(this.i, x);
    return { x, status, functions: this.rig.linear.functions(status) };
  }

  /** @param {[number, number] | undefined} range @returns {Found} */
  found(range) {
    const { rig, i, exact } = this, own = this.sample(rig.values[i]), { low, high, stretches } = this.whole(range);
    let row = [own, ...stretches.flatMap(({ at, count }) => this.swept(at, count)), ...middles(exact.filter((x) => x > low && x < high)).map((x) => this.sample(x))];
    row = this.certain(this.divided(ordered(row)));
    let edges = this.edges(row);
    if (!this.coarse && edges.length) {
      row = this.certain(this.divided(ordered([...row, ...edges.flatMap(({ at }) => this.beside(at, row))])));
      edges = this.edges(row);
    }
    return { edges, status: edges.length ? edges[0].below : own.status, low, high };
  }

  /** The range, and stretches of it: values at places 0 to `count`. @param {[number, number]} [range] */
  whole(range) {
    const { one, rig: { values }, i, fewer } = this, value = Math.abs(values[i]) || one.natural;
    if (one.high !== null) {
      const least = one.low ?? 0, inset = 1e-9 * (one.high - least), low = one.lowAllowed ? least : least + inset, high = one.highAllowed ? one.high : one.high - inset;
      return { low, high, stretches: [{ at: (n) => low + ((high - low) * n * fewer) / LINEAR, count: Math.floor(LINEAR / fewer) }] };
    }
    const [first, last] = range ?? [value, value], both = one.low === null || one.low < 0;
    const low = Math.min(value / FURTHEST, first > 0 ? first : value) || Number.MIN_VALUE, high = Math.min(Number.MAX_VALUE, Math.max(value * FURTHEST, last, -first));
    const ratio = Math.log(high) - Math.log(low), count = Math.min(AT_MOST, Math.ceil((ratio / Math.LN10) * (PER_DECADE / fewer)));
    const above = (n) => (n < count ? low * Math.exp((ratio * n) / count) : high), stretches = [{ at: above, count }];
    if (both) stretches.push({ at: (n) => -above(n), count });
    if (both || one.lowAllowed) stretches.push({ at: () => 0, count: 0 });
    return { low: both ? -high : one.lowAllowed ? 0 : low, high, stretches };
  }

  /** Samples at even places, and those in narrow windows between them. @param {(n: number) => number} at @param {number} count @returns {Sample[]} */
  swept(at, count) {
    const row = Array.from({ length: count + 1 }, (_, n) => this.sample(at(n))), dips = [];
    for (let f = this.rig.linear.many - 1; f >= 0; f--) {
      let before = 0, size = 0;
      for (let n = 1; n <= count; n++) {
        const next = n < count ? bend(row, n, f) : 0;
        if (size > BEND && size >= before && size > next) dips.push({ size, n: n - 1, f });
        [before, size] = [size, next];
      }
    }
    dips.sort((a, b) => b.size - a.size);
    return row.concat(...dips.slice(0, DIPS).map(({ n, f }) => this.descended(at, n - 1, n + 1, f)));
  }

  /** Samples behind the zeros to which a function dips between two places, none where it does not reach zero. */
  descended(at, low, high, f) {
    for (let pass = 0; pass < DEEP; pass++) {
      const place = (n) => low + ((high - low) * n) / PIECES, row = Array.from({ length: PIECES + 1 }, (_, n) => this.sample(at(place(n))));
      const behind = row.filter((one) => one.functions[f] > 0 !== row[0].functions[f] > 0 || one.status !== row[0].status);
      if (behind.length) return behind;
      const bends = row.map((_, n) => (n && n < PIECES ? bend(row, n, f) : 0)), most = bends.indexOf(Math.max(...bends));
      if (!(bends[most] > BEND)) return [];
      [low, high] = [place(most - 1), place(most + 1)];
    }
    return [];
  }

  /** Samples on both sides of an edge, ever closer: of three changes between two samples one alone has been seen. */
  beside(at, row) {
    return [-1, 1].flatMap((side) => {
      const next = side < 0 ? row.filter(({ x }) => x < at - SAME * Math.abs(at)).at(-1) : row.find(({ x }) => x > at + SAME * Math.abs(at));
      return next ? this.swept((n) => at + (next.x - at) * 10 ** (-n / PER_TEN), BESIDE_EDGE) : [];
    });
  }

  /** With a sample between the zeros of two functions that lie between two samples. @param {Sample[]} row */
  divided(row) {
    const further = /** @type {Sample[]} */ ([]);
    for (let n = 1; n < row.length; n++) {
      const low = row[n - 1], high = row[n];
      if (low.status !== high.status) continue;
      const zeros = [];
      for (let f = 0; f < low.functions.length; f++) if (low.functions[f] * high.functions[f] < 0) zeros.push(this.zero(low, high, f));
      if (zeros.length > 1) further.push(...middles(zeros.sort((a, b) => a - b)).map((x) => this.sample(x)));
    }
    return further.length ? ordered([...row, ...further]) : row;
  }

  /** The zero of a function between two samples. */
  zero(low, high, f) {
    while (high.x - low.x > EXACT * Math.max(Math.abs(low.x), Math.abs(high.x))) {
      const middle = this.sample(halfway(low.x, high.x));
      if (middle.x === low.x || middle.x === high.x) break;
      if (middle.functions[f] * low.functions[f] > 0) low = middle;
      else high = middle;
    }
    return high.x;
  }

  /** Without the samples beside a change whose status is a matter of rounding. @param {Sample[]} row */
  certain(row) {
    const found = /** @type {Sample[]} */ ([]), doubtful = (one) => (one.edge ??= this.rig.onEdge(this.i, one.x));
    for (const one of row) {
      while (found.length && found[found.length - 1].status !== one.status && doubtful(found[found.length - 1])) found.pop();
      if (!found.length || found[found.length - 1].status === one.status || !doubtful(one)) found.push(one);
    }
    return found;
  }

  /** Changes between samples, narrowed; what is too narrow to be gone to is left out. @param {Sample[]} row @returns {Edge[]} */
  edges(row) {
    const { one, exact } = this, found = /** @type {Edge[]} */ ([]);
    row.slice(1).forEach((high, n) => {
      const low = row[n], inner = exact.filter((x) => x > low.x && x < high.x), known = inner.length === 1 && [low, high].every(({ status }) => status !== ABSENT && status !== UNKNOWN);
      if (low.status === high.status) return;
      const at = known ? inner[0] : this.narrowed(low, high), size = Math.max(Math.abs(one.value), one.natural);
      if (one.low === 0 && low.x === 0 && at < END * high.x) return; // the end of the domain is no edge
      const zero = (one.low === null || one.low < 0) && Math.abs(at) < ROUNDED * size;
      found.push({ at: zero ? 0 : at, below: low.status, above: high.status });
    });
    return merged(found);
  }

  /** Where the status changes between two samples. @param {Sample} first @param {Sample} last */
  narrowed(first, last) {
    let [low, high] = [first.x, last.x];
    const share = this.coarse ? SEEN : EXACT, least = low === 0 ? ROUNDED * high : 0;
    for (let step = 0; step < 200 && high - low > Math.max(least, share * Math.max(Math.abs(low), Math.abs(high))); step++) {
      const middle = halfway(low, high);
      if (this.rig.status(this.i, middle) === first.status) low = middle;
      else high = middle;
    }
    return high;
  }
}

const halfway = (low, high) => (low > 0 && high > 4 * low ? Math.sqrt(low) * Math.sqrt(high) : 0.5 * (low + high));

/** Values between neighbours. @param {number[]} row rising */
const middles = (row) => row.slice(1).map((high, n) => halfway(row[n], high));

/** Samples that rise, each once. @param {Sample[]} row */
function ordered(row) {
  return row.sort((a, b) => a.x - b.x).filter(({ x }, n, all) => n === 0 || x !== all[n - 1].x);
}

/** How far a sample lies below the line through its neighbours, in the logarithm of a function of one sign and status. @param {Sample[]} row */
function bend(row, n, f) {
  const { status, functions } = row[n], own = functions[f], low = row[n - 1], high = row[n + 1], sign = own > 0 ? 1 : -1;
  if (low.status !== status || high.status !== status || !(sign * low.functions[f] > 0) || !(sign * high.functions[f] > 0)) return 0;
  return sign * (low.functions[f] + high.functions[f] - 2 * own);
}

/** Without states that nobody can go to, between two edges in the same place; rounding decides which of them is met first. @param {Edge[]} edges */
function merged(edges) {
  const found = /** @type {Edge[]} */ ([]);
  for (const edge of edges) {
    const last = found[found.length - 1];
    if (!last || edge.at - last.at > SAME * Math.abs(edge.at)) found.push({ ...edge });
    else if (last.below === edge.above) found.pop();
    else Object.assign(last, { at: last.below === ABSENT ? last.at : edge.at, above: edge.above });
  }
  return found;
}
