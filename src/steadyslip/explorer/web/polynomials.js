// Real polynomials, coefficients lowest power first: roots, Hurwitz test, and the k for which p + k q is stable.
// The counterpart of steadyslip/linear/polynomials.py, for one rig at a time.

/** @typedef {{re: number, im: number}} Complex */
/** @typedef {{low: number, high: number}} Interval */

const NEARLY_REAL = 1e-6, SAME = 1e-9, CLOSE = 1e-3, EPS = 2.220446049250313e-16;

/** Value and slope of a polynomial at x + iy: [re, im, slope re, slope im]. @param {number[]} c */
function valueAndSlope(c, x, y) {
  let pr = c[c.length - 1], pi = 0, qr = 0, qi = 0;
  for (let i = c.length - 2; i >= 0; i--) {
    const t = qr * x - qi * y + pr;
    qi = qr * y + qi * x + pi;
    qr = t;
    const u = pr * x - pi * y + c[i];
    pi = pr * y + pi * x;
    pr = u;
  }
  return [pr, pi, qr, qi];
}

/** Roots of c0 + c1 s + c2 s² without cancellation; a pair that is double to within rounding is real. */
function quadratic(c0, c1, c2) {
  let d = c1 * c1 - 4 * c0 * c2;
  if (Math.abs(d) <= 16 * EPS * c1 * c1) d = 0;
  const root = Math.sqrt(Math.abs(d));
  if (d < 0) {
    const re = (-0.5 * c1) / c2, im = Math.abs((0.5 * root) / c2);
    return [{ re, im }, { re, im: -im }];
  }
  const large = -0.5 * (c1 + (c1 < 0 ? -root : root));
  return [{ re: large / c2, im: 0 }, { re: large !== 0 ? c0 / large : 0, im: 0 }];
}

/** Where Aberth's iteration starts: on circles whose radii are slopes of the upper hull of ln|c| (Bini 1996). */
function circles(c) {
  const size = c.map((v) => (v === 0 ? -Infinity : Math.log(Math.abs(v)))), hull = [], n = c.length - 1;
  for (let i = 0; i <= n; i++) {
    if (size[i] === -Infinity) continue;
    while (hull.length > 1) {
      const a = hull[hull.length - 2], b = hull[hull.length - 1];
      if ((size[b] - size[a]) * (i - a) > (size[i] - size[a]) * (b - a)) break;
      hull.pop();
    }
    hull.push(i);
  }
  const x = [], y = [];
  for (let h = 0; h + 1 < hull.length; h++) {
    const a = hull[h], many = hull[h + 1] - a, radius = Math.exp((size[a] - size[hull[h + 1]]) / many);
    for (let j = 0; j < many; j++) {
      const angle = (2 * Math.PI * j) / many + 0.7 + h;
      x.push(radius * Math.cos(angle));
      y.push(radius * Math.sin(angle));
    }
  }
  return [x, y];
}

/** Aberth's iteration: all roots at once, each by Newton's step, repelled by the others. @param {number[]} c */
function aberth(c) {
  const [x, y] = circles(c), n = x.length;
  for (let pass = 0; pass < 100; pass++) {
    let moved = 0;
    for (let k = 0; k < n; k++) {
      const [pr, pi, qr, qi] = valueAndSlope(c, x[k], y[k]);
      if (pr === 0 && pi === 0) continue;
      const q = qr * qr + qi * qi || 1e-300, nr = (pr * qr + pi * qi) / q, ni = (pi * qr - pr * qi) / q;
      let sr = 0, si = 0;
      for (let j = 0; j < n; j++) {
        if (j === k) continue;
        const dx = x[k] - x[j], dy = y[k] - y[j], m = dx * dx + dy * dy || 1e-300;
        sr += dx / m;
        si -= dy / m;
      }
      const er = 1 - (nr * sr - ni * si), ei = -(nr * si + ni * sr), e = er * er + ei * ei || 1e-300;
      const wx = (nr * er + ni * ei) / e, wy = (ni * er - nr * ei) / e;
      x[k] -= wx;
      y[k] -= wy;
      moved = Math.max(moved, Math.hypot(wx, wy) / (Math.hypot(x[k], y[k]) || 1e-300));
    }
    if (moved < 4e-16) break;
  }
  return [x, y];
}

/** Points that are conjugate, or real, to within rounding made so exactly; two that are close found as a factor. */
function paired(c, x, y) {
  const found = [], real = [], left = new Set(x.keys());
  for (const k of x.keys()) {
    if (!left.delete(k)) continue;
    const size = Math.hypot(x[k], y[k]);
    let best = -1, gap = 1e-4 * size;
    for (const j of left) {
      const distance = Math.hypot(x[j] - x[k], y[j] + y[k]);
      if (distance < gap) [best, gap] = [j, distance];
    }
    if (Math.abs(y[k]) <= 1e-12 * size || best < 0) {
      real.push(x[k]);
      continue;
    }
    left.delete(best);
    const re = 0.5 * (x[k] + x[best]), im = 0.5 * Math.abs(y[k] - y[best]);
    if (2 * im < CLOSE * size) found.push(...factor(c, re, re * re + im * im));
    else found.push({ re, im }, { re, im: -im });
  }
  real.sort((a, b) => a - b);
  for (let i = 0; i < real.length; i++) {
    const one = real[i], other = real[i + 1];
    if (Math.abs(other - one) < CLOSE * Math.abs(one)) {
      found.push(...factor(c, 0.5 * (one + other), one * other));
      i++;
    } else found.push({ re: one, im: 0 });
  }
  return found;
}

/** Two roots close to each other, of mean `middle`, from their common factor s² + u s + w by Bairstow's iteration. */
function factor(c, middle, times) {
  const size = Math.abs(middle), scaled = c.map((v, i) => v * size ** i);
  let u = (-2 * middle) / size, w = times / (size * size);
  for (let pass = 0; pass < 5; pass++) {
    const b = [0, 0], slope = [0, 0]; // of the polynomial over the factor, and of that once more
    for (let i = scaled.length - 1; i >= 0; i--) {
      b.push(scaled[i] - u * b[b.length - 1] - w * b[b.length - 2]);
      slope.push(b[b.length - 1] - u * slope[slope.length - 1] - w * slope[slope.length - 2]);
    }
    const [c3, c2, c1] = slope.slice(-4, -1), [b1, b0] = b.slice(-2), determinant = c2 * c2 - c1 * c3;
    const du = (b1 * c2 - b0 * c3) / determinant, dw = (b0 * c2 - b1 * c1) / determinant;
    if (!(Math.abs(du) + Math.abs(dw) < 0.1)) break;
    u += du;
    w += dw;
  }
  return quadratic(w, u, 1).map((s) => ({ re: s.re * size, im: s.im * size }));
}

/**
 * All roots, by falling real part.
 * @param {ArrayLike<number>} given
 * @returns {Complex[]}
 */
export function roots(given) {
  const c = Array.from(given);
  while (c.length > 1 && c[c.length - 1] === 0) c.pop();
  let zeros = 0;
  while (c.length > 1 && c[0] === 0) {
    c.shift();
    zeros++;
  }
  const d = c.length - 1, found = Array.from({ length: zeros }, () => ({ re: 0, im: 0 }));
  if (c.every(Number.isFinite)) {
    if (d === 1) found.push({ re: -c[0] / c[1], im: 0 });
    else if (d === 2) found.push(...quadratic(c[0], c[1], c[2]));
    else if (d > 2) found.push(...paired(c, ...aberth(c)));
  }
  return found.sort((a, b) => b.re - a.re || b.im - a.im);
}

let upper = new Float64Array(16), lower = new Float64Array(16); // rows of Routh's array

/** Whether the highest coefficient is positive and all roots have negative real parts (Routh). @param {ArrayLike<number>} c */
export function isHurwitz(c) {
  const n = c.length - 1;
  let d = n, most = 0;
  while (d >= 0 && c[d] === 0) d--;
  if (d < Math.max(n - 1, 0)) return false; // the equations have lost more than their inertia: ill-posed
  for (let i = 0; i <= d; i++) most = Math.max(most, Math.abs(c[i]));
  if (d + 2 > upper.length) [upper, lower] = [new Float64Array(d + 2), new Float64Array(d + 2)];
  const width = (d >> 1) + 1;
  for (let i = 0; i < width; i++) {
    upper[i] = c[d - 2 * i] / most;
    lower[i] = d - 1 - 2 * i >= 0 ? c[d - 1 - 2 * i] / most : 0;
  }
  lower[width] = 0;
  for (let row = 0; row <= d; row++) {
    if (!(upper[0] > 0)) return false;
    const ratio = upper[0] / lower[0];
    for (let i = 1; i < width; i++) upper[i - 1] = upper[i] - ratio * lower[i];
    upper[width - 1] = 0;
    [upper, lower] = [lower, upper];
  }
  return true;
}

/** Whether the equations cannot be solved for their unknown (theory 3). @param {ArrayLike<number>} c */
export const isIllPosed = (c) => c[c.length - 1] < 0 || (c[c.length - 1] === 0 && c[c.length - 2] <= 0);

const evaluate = (c, s) => c.reduceRight((value, coefficient) => value * s + coefficient, 0);

/** E and O with c(iβ) = E(β²) + iβ O(β²). */
function evenOdd(c) {
  const part = (from) => c.filter((_, i) => i % 2 === from).map((v, i) => (i % 2 ? -v : v));
  return [part(0), c.length > 1 ? part(1) : [0]];
}

function product(a, b) {
  const out = new Array(a.length + b.length - 1).fill(0);
  a.forEach((x, i) => b.forEach((y, j) => (out[i + j] += x * y)));
  return out;
}

/** β² > 0 where p(iβ)/q(iβ) is real, and the k there. */
function oscillatory(p, q) {
  const [pe, po] = evenOdd(p), [qe, qo] = evenOdd(q), a = product(po, qe), b = product(pe, qo), rest = [];
  for (let i = 0; i < Math.max(a.length, b.length); i++) {
    const one = a[i] || 0, other = b[i] || 0, small = 8 * EPS * (Math.abs(one) + Math.abs(other));
    rest.push(Math.abs(one - other) < small ? 0 : one - other); // of an exact cancellation nothing is left
  }
  const found = [];
  for (const { re: w, im } of roots(rest)) {
    if (!(w > 0) || Math.abs(im) > NEARLY_REAL * Math.hypot(w, im)) continue;
    const [e1, o1, e2, o2] = [pe, po, qe, qo].map((part) => evaluate(part, w));
    found.push([-(e1 * e2 + w * o1 * o2) / (e2 * e2 + w * o2 * o2), Math.sqrt(w)]);
  }
  return found;
}

/**
 * The k > 0 for which p + k q has all roots in the left half plane.
 * @param {number[]} p
 * @param {number[]} q
 * @returns {{intervals: Interval[], edges: {k: number, frequency: number}[]}} edges where stability changes
 */
export function stableSet(p, q) {
  const n = p.length - 1, none = p[n] === 0 && q[n] === 0;
  const all = [[-p[0] / q[0], 0], [none ? -p[n - 1] / q[n - 1] : -p[n] / q[n], Infinity], ...oscillatory(p, q)];
  const cuts = all.filter(([k]) => k > 0 && Number.isFinite(k)).sort((a, b) => a[0] - b[0]);
  const apart = cuts.filter(([k], i) => i === 0 || k > cuts[i - 1][0] * (1 + SAME));
  const ratios = p.map((v, i) => Math.abs(v / q[i])).filter((r) => r > 0 && Number.isFinite(r));
  const natural = ratios.length ? Math.max(...ratios) : 1;
  const stable = [];
  for (let i = 0; i <= apart.length; i++) {
    const low = i > 0 ? apart[i - 1][0] : 0, high = i < apart.length ? apart[i][0] : Infinity;
    const last = low > 0 ? 2 * low : natural, inner = low > 0 ? Math.sqrt(low) * Math.sqrt(high) : high / 2;
    const k = high === Infinity ? last : inner;
    stable.push(isHurwitz(p.map((v, j) => v + k * q[j])));
  }
  const intervals = [], edges = [];
  for (let i = 0; i <= apart.length; i++) {
    if (i > 0 && stable[i] !== stable[i - 1]) edges.push({ k: apart[i - 1][0], frequency: apart[i - 1][1] });
    if (!stable[i]) continue;
    const low = i > 0 ? apart[i - 1][0] : 0, high = i < apart.length ? apart[i][0] : Infinity;
    const last = intervals[intervals.length - 1];
    if (last && i > 0 && stable[i - 1]) last.high = high;
    else intervals.push({ low, high });
  }
  return { intervals, edges };
}

/**
 * Damping ratios' kin: scale-free distances of the least damped pair and of the least damped real root from the axis.
 * @param {Complex[]} found
 * @returns {number} of the pair, NaN if there is none
 */
export function dampingOfPairs(found) {
  let least = Infinity;
  for (let i = 0; i < found.length; i++) {
    for (let j = i + 1; j < found.length; j++) {
      const a = found[i], b = found[j], real = a.im === 0 && b.im === 0;
      const size = real ? a.re * b.re : a.re * a.re + a.im * a.im;
      if (real ? size > 0 : a.re === b.re && a.im === -b.im) least = Math.min(least, -(a.re + b.re) / Math.sqrt(size));
    }
  }
  return least === Infinity ? NaN : least;
}
