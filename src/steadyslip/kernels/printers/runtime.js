// What generated programs and the transpiled driver call. Elementary functions keep the promises of
// kernels/primitives.py at the ends of their ranges; the rest is what Python has and JavaScript has not.

const POWERS = Float64Array.from({ length: 2045 }, (_, i) => 2 ** (i - 1022)); // of two, all that have 53 bits
const ROUND = 6755399441055744; // 1.5 * 2 ** 52: adding it rounds to an integer

/** e^x to the last bit as in the kernels, and twice as fast as Math.exp where one waits for another. @param {number} x */
export function exp(x) {
  if (!(x <= 700)) return x > 700 ? 1.0142320547350045e304 : NaN;
  if (x < -700) return 0;
  const n = x * 1.4426950408889634 + ROUND - ROUND;
  const r = x - n * 0.6931471805598903, r2 = r * r, r4 = r2 * r2;
  const low = (1 / 6 * r + 0.5) * r2 + (1 + r);
  const middle = (1 / 5040 * r + 1 / 720) * r2 + (1 / 120 * r + 1 / 24);
  const high = (1 / 39916800 * r + 1 / 3628800) * r2 + (1 / 362880 * r + 1 / 40320);
  const top = (1 / 6227020800 * r + 1 / 479001600) * r4 + high;
  return (top * (r4 * r4) + (middle * r4 + low)) * (POWERS[n + 1022] * (1 - n * 5.497923018708371e-14));
}

const DOUBLE = new Float64Array(1), HALVES = new Uint32Array(DOUBLE.buffer); // the lower word first, as on all that browsers run on

/** ln x to within .03, for positive numbers. @param {number} x */
export function rough_log(x) {
  DOUBLE[0] = x;
  return ((HALVES[1] - 0x3ff00000) * 4294967296 + HALVES[0]) * 1.539095918623324e-16 + 0.02983;
}

const TINY = 2 ** -1022, LEAST = exp(-700), LARGE = 2 ** 500, FARTHEST = 2 ** 45; // as in the kernels

export const abs = Math.abs, sqrt = Math.sqrt, tanh = Math.tanh, sign = Math.sign;

/** ln x; NaN below zero, and finite at both ends. @param {number} x */
export const log = (x) => (x >= 0 ? Math.log(Math.min(Math.max(x, TINY), Number.MAX_VALUE)) : NaN);

/** ln(1 + x), as finite as log. @param {number} x */
export const log1p = (x) => (x > -1 && x < LARGE ? Math.log1p(x) : log(1 + x));

/** x^y; ends as exp does. @param {number} x @param {number} y */
export function power(x, y) {
  if (x === 0 && y > 0) return 0;
  const whole = Math.max(Math.abs(x), TINY) ** y, size = whole < LEAST ? 0 : Math.min(whole, exp(700)); // NaN stays NaN
  return x < 0 ? (Number.isInteger(y) ? (y % 2 ? -size : size) : NaN) : size;
}

/** e^x - 1; saturates as exp does. @param {number} x */
export const expm1 = (x) => Math.expm1(x > 700 ? 700 : x);

/** Saturates as exp does. @param {number} x */
export const sinh = (x) => Math.sinh(Math.min(Math.max(x, -700), 700));

/** Saturates as exp does. @param {number} x */
export const cosh = (x) => Math.cosh(Math.min(Math.abs(x), 700));

/** Inverse hyperbolic sine, as finite as log. @param {number} x */
export const asinh = (x) => (Math.abs(x) > LARGE ? Math.sign(x) * (log(Math.abs(x)) + Math.LN2) : Math.asinh(x));

/** asinh(x e^y) without overflow or underflow on the way, as in the kernels. @param {number} x @param {number} y */
export function asinh_exp(x, y) {
  const size = Math.abs(x), far = y < -1400, factor = far ? LEAST : 1;
  const half = exp((far ? y + 1400 : y) / 2), product = size * factor * half * (factor * half);
  const z = product > LARGE ? log(size) + y + Math.LN2 : Math.asinh(product);
  return x >= 0 ? z : -z;
}

/** Sine; NaN where turns cannot be counted. @param {number} x */
export const sin = (x) => (Math.abs(x) <= FARTHEST ? Math.sin(x) : NaN);

/** Cosine; NaN where turns cannot be counted. @param {number} x */
export const cos = (x) => (Math.abs(x) <= FARTHEST ? Math.cos(x) : NaN);

/** The smaller of two; the first where the second is NaN, as in Python. @param {number} a @param {number} b */
export const smaller = (a, b) => (b < a ? b : a);

/** The larger of two; the first where the second is NaN, as in Python. @param {number} a @param {number} b */
export const larger = (a, b) => (b > a ? b : a);

/** What is left of a division, of the sign of the divisor, as in Python. @param {number} a @param {number} b */
export const modulo = (a, b) => a - b * Math.floor(a / b);

/** What a kernel does not have. */
export const absent = () => {
  throw new Error("this kernel has no such routine");
};

/**
 * An array of zeros, of one index or more. The innermost rows are typed arrays, all of them parts of one; `shape` says how
 * many there are.
 * @param {...number} shape
 * @returns {any}
 */
export function zeros(...shape) {
  const all = new Float64Array(shape.reduce((a, b) => a * b, 1));
  /** @param {number} depth @param {number} from @param {number} size @returns {any} */
  const part = (depth, from, size) => {
    if (depth === shape.length - 1) return depth ? all.subarray(from, from + size) : all;
    const each = size / shape[depth] || 0;
    return Array.from({ length: shape[depth] }, (_, i) => part(depth + 1, from + i * each, each));
  };
  const made = part(0, 0, all.length);
  made.shape = shape;
  return made;
}

/**
 * Nested numbers as the driver takes them.
 * @param {any} values
 * @param {number[]} shape
 * @returns {any}
 */
export function table(values, shape) {
  const made = zeros(...shape);
  /** @param {any} into @param {any} from */
  const fill = (into, from) => {
    for (let i = 0; i < into.length; i++) {
      if (typeof into[i] === "number") into[i] = from[i] === null ? NaN : from[i];
      else fill(into[i], from[i]);
    }
  };
  fill(made, values);
  return made;
}
