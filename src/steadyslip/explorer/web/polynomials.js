// Roots of real polynomials, coefficients lowest power first, by Aberth's iteration. The polynomials of a rig are
// generated (steadyslip/explorer/equations.py).

/** @typedef {{re: number, im: number}} Complex */

const CLOSE = 1e-3, EPS = 2.220446049250313e-16;
const SETTLED = 1e-10; // relative step below which a simple root converges in one more step

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

/** Roots of c0 + c1 s + c2 s² without cancellation; a double pair (to rounding) is made real. */
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

/** Starting points of Aberth's iteration: on circles with radii from the upper hull of ln|c| (Bini 1996). */
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
  const [x, y] = circles(c), n = x.length, steps = new Float64Array(n).fill(Infinity);
  for (let pass = 0, left = n; pass < 100 && left; pass++) {
    for (let k = 0; k < n; k++) {
      if (steps[k] === 0) continue;
      const [pr, pi, qr, qi] = valueAndSlope(c, x[k], y[k]);
      if (pr === 0 && pi === 0) {
        steps[k] = 0;
        left--;
        continue;
      }
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
      const step = Math.hypot(wx, wy) / (Math.hypot(x[k], y[k]) || 1e-300);
      const still = step < 4e-16 || (step < SETTLED && step > 0.5 * steps[k]); // converged, or moved by rounding only
      steps[k] = still ? 0 : step;
      if (still) left--;
    }
  }
  return [x, y];
}

/** Roots made exactly real or conjugate where they are so to rounding; close pairs are found as quadratic factors. */
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

/** Two close roots of mean `middle`, from their factor s² + u s + w by Bairstow's iteration. */
function factor(c, middle, times) {
  const size = Math.abs(middle), scaled = c.map((v, i) => v * size ** i);
  let u = (-2 * middle) / size, w = times / (size * size);
  for (let pass = 0; pass < 5; pass++) {
    const b = [0, 0], slope = [0, 0]; // remainders of the division by the factor, and of the quotient by it
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

/** True if a polynomial has even powers only. @param {ArrayLike<number>} c */
export const isEven = (c) => Array.from(c).every((value, k) => k % 2 === 0 || value === 0);

/** Both square roots of a root in s², exactly on the axis where that is negative. @param {Complex} u @returns {Complex[]} */
function squareRoots({ re, im }) {
  const large = Math.sqrt(0.5 * (Math.hypot(re, im) + Math.abs(re))), small = im && (0.5 * Math.abs(im)) / large;
  const [x, y] = re < 0 ? [small, large] : [large, small];
  return [{ re: x, im: im < 0 ? -y : y }, { re: -x || 0, im: im < 0 ? y : -y || 0 }];
}

/**
 * All roots, by falling real part.
 * @param {ArrayLike<number>} given
 * @returns {Complex[]}
 */
export function roots(given) {
  const c = Array.from(given);
  if (c.length > 3 && isEven(c)) return falling(roots(c.filter((_, k) => k % 2 === 0)).flatMap(squareRoots));
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
  return falling(found);
}

/** Roots by falling real part, those with the same one by rising frequency. @param {Complex[]} found */
const falling = (found) => found.sort((a, b) => b.re - a.re || Math.abs(a.im) - Math.abs(b.im) || b.im - a.im);
