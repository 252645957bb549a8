// Changes of status along one parameter, found as in steadyslip/linear/search.py: the parameter is sampled over its range,
// functions that vanish at every edge are searched where they dip between samples, and parameters that enter linearly
// have exact edges. These functions are generated (steadyslip/explorer/equations.py, sliding.py).
import { ABSENT, SAME, UNDAMPED, UNKNOWN } from "./linear.js";
import { inside } from "./rig.js";

/** @typedef {{x: number, status: number, functions: number[], edge?: boolean}} Sample `functions` as `Linear.functions` has them */
/** @typedef {{at: number, below: number, above: number}} Edge place of a change of status, and the status below and above */
/** @typedef {{edges: Edge[], status: number, low: number, high: number}} Found `status` is that at `low`, for a range without edges */

const PER_DECADE = 40, FURTHEST = 1e6, LINEAR = 720; // samples as in Python: per decade; factor to each side of the value; on a linear range
const AT_MOST = 2000; // most samples, for absurd ranges
const COARSE = 6, COARSER = 20; // factors of fewer samples: COARSE while a slider moves or if edges are exact; COARSER for both, or if σss must be searched
const BEND = 1; // bend of ln|function| over three samples that makes a dip: two zeros between them bend it by 2 ln 3 or more, powers hardly
const DIPS = 16, PIECES = 8, DEEP = 14; // DIPS: most dips searched; PIECES of a bracket; DEEP: refinements, each to a quarter
const BESIDE_EDGE = 24, PER_TEN = 4; // samples beside an edge, PER_TEN for each decade of distance
const EXACT = 1e-13, SEEN = 1e-5; // relative precision of an edge, and while a slider moves
const ROUNDED = 1e-12, END = 1e-9; // ROUNDED: relative size of rounding; END: a change below this share of the lowest sample is the end of the domain

/**
 * All changes of status along a parameter, the others fixed.
 * @param {import("./rig.js").Rig} rig @param {number} i
 * @param {[number, number]} [range] searched besides the range of Python
 * @param {boolean} [coarse] true if fewer samples are enough
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
    return { edges, status: edges.length ? edges[0].below : row[row.length - 1].status, low, high };
  }

  /** Search range and its sample values, as a function of the index 0 to `count`. @param {[number, number]} [range] */
  whole(range) {
    const { one, rig: { values }, i, fewer } = this, value = Math.abs(values[i]) || one.natural, [least, most] = this.coarse ? [value, value] : [value, one.natural].sort((a, b) => a - b);
    if (one.high !== null) {
      const least = one.low ?? 0, inset = 1e-9 * (one.high - least), low = one.lowAllowed ? least : least + inset, high = one.highAllowed ? one.high : one.high - inset;
      return { low, high, stretches: [{ at: (n) => low + ((high - low) * n * fewer) / LINEAR, count: Math.floor(LINEAR / fewer) }] };
    }
    const [first, last] = range ?? [value, value], both = one.low === null || one.low < 0;
    const low = Math.min(least / FURTHEST, first > 0 ? first : value) || Number.MIN_VALUE, high = Math.min(Number.MAX_VALUE, Math.max(most * FURTHEST, last, -first));
    const ratio = Math.log(high) - Math.log(low), count = Math.min(AT_MOST, Math.ceil((ratio / Math.LN10) * (PER_DECADE / fewer)));
    const above = (n) => (n < count ? low * Math.exp((ratio * n) / count) : high), stretches = [{ at: above, count }];
    if (both) stretches.push({ at: (n) => -above(n), count });
    if (both || one.lowAllowed) stretches.push({ at: () => 0, count: 0 });
    return { low: both ? -high : one.lowAllowed ? 0 : low, high, stretches };
  }

  /** Samples at all indices, and samples inside narrow windows between them. @param {(n: number) => number} at @param {number} count @returns {Sample[]} */
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

  /** Samples behind the zeros of a function that dips between two places; empty if it does not reach zero. */
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

  /** Samples ever closer to an edge on both sides, as three changes between two samples look like one. */
  beside(at, row) {
    return [-1, 1].flatMap((side) => {
      const next = side < 0 ? row.filter(({ x }) => x < at - SAME * Math.abs(at)).at(-1) : row.find(({ x }) => x > at + SAME * Math.abs(at));
      return next ? this.swept((n) => at + (next.x - at) * 10 ** (-n / PER_TEN), BESIDE_EDGE) : [];
    });
  }

  /** Samples with one more between the zeros of two functions, where both lie between neighbours. @param {Sample[]} row */
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

  /** Zero of a function between two samples. */
  zero(low, high, f) {
    while (high.x - low.x > EXACT * Math.max(Math.abs(low.x), Math.abs(high.x))) {
      const middle = this.sample(halfway(low.x, high.x));
      if (middle.x === low.x || middle.x === high.x) break;
      if (middle.functions[f] * low.functions[f] > 0) low = middle;
      else high = middle;
    }
    return high.x;
  }

  /** Samples without those beside a change whose status depends on rounding. @param {Sample[]} row */
  certain(row) {
    const found = /** @type {Sample[]} */ ([]), doubtful = (one) => (one.edge ??= one.status !== UNDAMPED && this.rig.onEdge(this.i, one.x));
    for (const one of row) {
      while (found.length && found[found.length - 1].status !== one.status && doubtful(found[found.length - 1])) found.pop();
      if (!found.length || found[found.length - 1].status === one.status || !doubtful(one)) found.push(one);
    }
    return found;
  }

  /** Edges between samples to full precision, without windows too narrow to hold a value. @param {Sample[]} row @returns {Edge[]} */
  edges(row) {
    const { one, exact } = this, found = /** @type {Edge[]} */ ([]);
    row.slice(1).forEach((high, n) => {
      const low = row[n], inner = exact.filter((x) => x > low.x && x < high.x), known = inner.length === 1 && [low, high].every(({ status }) => status !== ABSENT && status !== UNKNOWN);
      if (low.status === high.status) return;
      const at = known ? inner[0] : this.narrowed(low, high), size = Math.max(Math.abs(one.value), one.natural);
      if (one.low === 0 && low.x === 0 && at < END * high.x) return; // the end of the domain is not an edge
      const zero = (one.low === null || one.low < 0) && Math.abs(at) < ROUNDED * size;
      found.push({ at: zero ? 0 : at, below: low.status, above: high.status });
    });
    return merged(found);
  }

  /** Edge between two samples of different status. @param {Sample} first @param {Sample} last */
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

/** Midpoints of neighbours. @param {number[]} row rising */
const middles = (row) => row.slice(1).map((high, n) => halfway(row[n], high));

/** Samples in rising order, without duplicates. @param {Sample[]} row */
function ordered(row) {
  return row.sort((a, b) => a.x - b.x).filter(({ x }, n, all) => n === 0 || x !== all[n - 1].x);
}

/** Depth of a sample below the line through its neighbours, in ln|function|, where sign and status are the same. @param {Sample[]} row */
function bend(row, n, f) {
  const { status, functions } = row[n], own = functions[f], low = row[n - 1], high = row[n + 1], sign = own > 0 ? 1 : -1;
  if (low.status !== status || high.status !== status || !(sign * low.functions[f] > 0) || !(sign * high.functions[f] > 0)) return 0;
  return sign * (low.functions[f] + high.functions[f] - 2 * own);
}

/** Edges with those in one place joined; the status between them depends on rounding and has no width. @param {Edge[]} edges */
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
