// What generated programs and the transpiled driver call. Elementary functions keep the promises of
// kernels/primitives.py at the ends of their ranges; the rest is what Python has and JavaScript has not.

/** e^x; saturates at e^±700. @param {number} x */
export const exp = (x) => Math.exp(x > 700 ? 700 : x < -700 ? -700 : x);

/** ln x; NaN below zero, about -708 at 0. @param {number} x */
export const log = (x) => (x >= 0 ? Math.log(x > 2.2250738585072014e-308 ? x : 2.2250738585072014e-308) : NaN);

export const log1p = Math.log1p, sinh = Math.sinh, cosh = Math.cosh, tanh = Math.tanh;
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
 * An array of zeros, of one index or more; the last dimension is one typed array, and `shape` says how many there are.
 * @param {...number} shape
 * @returns {any}
 */
export function zeros(...shape) {
  const [first, ...rest] = shape;
  /** @type {any} */
  const made = rest.length ? Array.from({ length: first }, () => zeros(...rest)) : new Float64Array(first);
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
