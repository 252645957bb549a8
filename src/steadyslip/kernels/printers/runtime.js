// What generated programs and the transpiled driver call. Elementary functions keep the promises of
// kernels/primitives.py at the ends of their ranges; the rest is what Python has and JavaScript has not.

const POWERS = Float64Array.from({ length: 2045 }, (_, i) => 2 ** (i - 1022)); // of two, all that have 53 bits
const ROUND = 6755399441055744; // 1.5 * 2 ** 52: adding it rounds to an integer

/** e^x to the last bit as in the kernels, and twice as fast as Math.exp where one waits for another. @param {number} x */
export function exp(x) {
  if (!(x <= 700)) return x > 700 ? 1.0142320547350045e304 : NaN;
  if (x < -700) return 9.859676543759770e-305;
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

/** ln x; NaN below zero, about -708 at 0. @param {number} x */
export const log = (x) => (x >= 0 ? Math.log(x > 2.2250738585072014e-308 ? x : 2.2250738585072014e-308) : NaN);

export const abs = Math.abs, sqrt = Math.sqrt, log1p = Math.log1p, sinh = Math.sinh, cosh = Math.cosh, tanh = Math.tanh;
export const asinh = Math.asinh, sin = Math.sin, cos = Math.cos, sign = Math.sign, power = Math.pow;

/** e^x - 1; saturates as exp does. @param {number} x */
export const expm1 = (x) => Math.expm1(x > 700 ? 700 : x);

/** asinh(x e^y) without overflow. @param {number} x @param {number} y */
export function asinh_exp(x, y) {
  const size = log(Math.abs(x)) + y;
  const z = size > 20 ? size + 0.6931471805599453 : Math.asinh(exp(size));
  return x >= 0 ? z : -z;
}

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
