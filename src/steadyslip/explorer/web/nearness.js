// How far values of a parameter are from each other, and which are next to one: as in steadyslip/linear/nearness.py.

/** Doublings from one value to another; of angles radians. @param {number} value @param {number} other */
export function doublings(value, other, unit = "") {
  const ratio = other / value;
  return unit === "rad" ? Math.abs(other - value) : value === other ? 0 : !value || !other ? 1 : ratio > 0 ? Math.abs(Math.log2(ratio)) : 1 + Math.log2(1 - ratio);
}

/** Those of some things next to a value, below and above it, nearest first. @template T @param {T[]} all @param {(one: T) => number} at @param {number} own @returns {T[]} */
export function about(all, at, own, unit = "") {
  const gap = (one) => Math.abs(at(one) - own), far = (one) => doublings(own, at(one), unit);
  const next = (some) => some.sort((a, b) => gap(a) - gap(b)).slice(0, 1), above = next(all.filter((one) => at(one) >= own));
  if (above.length && !gap(above[0])) return above;
  return [...next(all.filter((one) => at(one) < own)), ...above].sort((a, b) => far(a) - far(b) || gap(a) - gap(b));
}
