// Modes of a machine: null vector of the characteristic matrix, shares of energy, and sentences.
// Matrix, speeds and energies are generated (steadyslip/explorer/modes.py), words are those of steadyslip/linear/modes.py.

/** @typedef {{re: number, im: number}} Complex */

const times = (a, b) => ({ re: a.re * b.re - a.im * b.im, im: a.re * b.im + a.im * b.re });
const over = (a, b) => {
  const size = b.re * b.re + b.im * b.im;
  return { re: (a.re * b.re + a.im * b.im) / size, im: (a.im * b.re - a.re * b.im) / size };
};
const sizeOf = (a) => Math.hypot(a.re, a.im);

/**
 * Null vector of a singular matrix, by Gaussian elimination with complete pivoting after balancing.
 * @param {Complex[][]} given @param {number[][]} sizes of the terms of each entry, so that rounding in a row of zeros is not taken for an entry
 */
function nullVector(given, sizes) {
  const n = given.length, order = Array.from({ length: n }, (_, i) => i), columns = new Float64Array(n).fill(1);
  const heights = () => sizes.map((row) => Math.max(...row.map((size, j) => size * columns[j])));
  for (let pass = 0; pass < 3; pass++) {
    const tall = heights();
    for (let j = 0; j < n; j++) columns[j] /= Math.max(...sizes.map((row, i) => (row[j] * columns[j]) / tall[i]), 1e-300);
  }
  const tall = heights(), rows = given.map((row, i) => row.map((e, j) => ({ re: (e.re * columns[j]) / tall[i], im: (e.im * columns[j]) / tall[i] })));
  for (let k = 0; k < n - 1; k++) {
    let row = k, column = k;
    for (let i = k; i < n; i++) for (let j = k; j < n; j++) if (sizeOf(rows[i][j]) > sizeOf(rows[row][column])) [row, column] = [i, j];
    [rows[k], rows[row]] = [rows[row], rows[k]];
    for (const one of rows) [one[k], one[column]] = [one[column], one[k]];
    [order[k], order[column]] = [order[column], order[k]];
    for (let i = k + 1; i < n; i++) {
      const factor = over(rows[i][k], rows[k][k]);
      for (let j = k; j < n; j++) {
        const less = times(factor, rows[k][j]);
        rows[i][j] = { re: rows[i][j].re - less.re, im: rows[i][j].im - less.im };
      }
    }
  }
  const found = Array.from({ length: n }, () => ({ re: 0, im: 0 }));
  found[n - 1] = { re: 1, im: 0 };
  for (let k = n - 2; k >= 0; k--) {
    let sum = { re: 0, im: 0 };
    for (let j = k + 1; j < n; j++) {
      const term = times(rows[k][j], found[j]);
      sum = { re: sum.re - term.re, im: sum.im - term.im };
    }
    found[k] = over(sum, rows[k][k]);
  }
  const vector = Array.from(found);
  order.forEach((place, k) => (vector[place] = { re: found[k].re * columns[place], im: found[k].im * columns[place] }));
  return vector;
}

/** Mode of an eigenvalue: amplitudes of all coordinates over the largest, and shares of the energy. @param {any} linear @param {Complex} given */
export function modeOf(linear, given) {
  const { coordinates, matrix: [size, entries], stores } = linear.facts, s = { re: given.re, im: Math.abs(given.im) };
  const found = linear.ask("matrix", entries.length), matrix = Array.from({ length: size }, () => Array.from({ length: size }, () => ({ re: 0, im: 0 })));
  const sizes = matrix.map((row) => row.map(() => 0));
  entries.forEach(([i, j, power], n) => {
    let term = { re: found[n], im: 0 };
    for (let k = 0; k < power; k++) term = times(term, s);
    matrix[i][j] = { re: matrix[i][j].re + term.re, im: matrix[i][j].im + term.im };
    sizes[i][j] += sizeOf(term);
  });
  const shape = nullVector(matrix, sizes), many = stores.reduce((sum, [, , places]) => sum + 1 + places.length, 0);
  const [drive, ...measures] = linear.ask("measures", 1 + coordinates.length + many), weights = measures.slice(coordinates.length);
  const ways = coordinates.map((_, n) => ({ re: shape[n].re * (measures[n] ? drive / measures[n] : 1), im: shape[n].im * (measures[n] ? drive / measures[n] : 1) }));
  const largest = ways.reduce((a, b) => (sizeOf(b) > sizeOf(a) ? b : a)), energy = /** @type {Record<string, number>} */ ({});
  let at = 0, total = 0;
  for (const [name, kinetic, places] of stores) {
    const stretch = places.reduce((sum, place, n) => ({ re: sum.re + weights[at + 1 + n] * shape[place].re, im: sum.im + weights[at + 1 + n] * shape[place].im }), { re: 0, im: 0 });
    const own = weights[at] * sizeOf(kinetic ? times(s, stretch) : stretch) ** 2;
    energy[name] = (energy[name] ?? 0) + own;
    total += own;
    at += 1 + places.length;
  }
  if (!shape.every((one) => Number.isFinite(one.re) && Number.isFinite(one.im))) return null;
  for (const name of Object.keys(energy)) energy[name] /= total;
  return {
    eigenvalue: s, amplitudes: Object.fromEntries(coordinates.map((name, n) => [name, sizeOf(largest) ? over(ways[n], largest) : ways[n]])),
    energy: total > 0 && Number.isFinite(total) ? energy : {},
  };
}

/** Template text with its {names} replaced by values. @param {string} template @param {Record<string, any>} values */
export const fill = (template, values) => template.replace(/\{(\w+)\}/g, (_, name) => values[name]);

/** Share in per cent, with enough digits to differ from 0 and 100. @param {number} share */
export function percent(share) {
  const text = Number((100 * share).toPrecision(3));
  return `${share > 0 && share < 1 && (text === 0 || text === 100) ? Number((100 * share).toPrecision(8)) : text} %`;
}

/** Sentence on the shape of a mode. @param {any} mode @param {any} shape words and limits */
export function words(mode, { moves, hardly, many, named: few, suffix, words: said }) {
  const sizes = Object.entries(mode.amplitudes).map(([name, one]) => /** @type {[string, number]} */ ([name, sizeOf(one)]));
  const named = (test) => sizes.filter(([, size]) => test(size)).map(([name]) => name), bodyOf = (name) => (name.endsWith(suffix) ? name.slice(0, -suffix.length) : name);
  const crowd = sizes.length > many, largest = [...sizes].sort(([, a], [, b]) => b - a).slice(0, few).map(([name]) => name);
  const leads = crowd ? largest : named((size) => size >= moves), rest = crowd ? [] : sizes.filter(([, size]) => size >= hardly && size < moves);
  const still = crowd ? [] : named((size) => size < hardly);
  const wayOf = (body, names) => (body + suffix in mode.amplitudes ? said[names.includes(body + suffix) ? (names.includes(body) ? "both" : "away") : "along"] : "");
  const withWay = (body, names) => body + (wayOf(body, names) ? fill(said.way, { way: wayOf(body, names) }) : "");
  const bodiesOf = (names) => [...new Set(names.map(bodyOf))], movers = bodiesOf(leads), [first] = movers, alone = movers.length === 1;
  const listed = (names) => {
    const all = names.map((name) => fill(said.the, { name }));
    return all.length === 1 ? all[0] : all.slice(0, -1).join(", ") + said.and + all[all.length - 1];
  };
  const does = (what, names) => said[what].split("|")[names.length > 1 ? 1 : 0], way = alone ? wayOf(first, leads) : "";
  const direction = way && ` ${way}${still.includes(first) ? said.hardly_along : still.includes(first + suffix) ? said.hardly_away : ""}`;
  const others = alone ? still.filter((name) => bodyOf(name) !== first) : still;
  const parts = [`${listed(alone ? movers : movers.map((body) => withWay(body, leads)))} ${does(mode.eigenvalue.im ? "oscillate" : "drift", movers)}${direction}${crowd ? fill(said.most, { count: sizes.length }) : ""}`];
  if (leads.length === 2 && leads[0].replace(suffix, "") !== leads[1].replace(suffix, "")) {
    const [a, b] = leads.map((name) => mode.amplitudes[name]);
    if (a.re * b.re + a.im * b.im < 0) parts[0] += said.opposed;
  }
  if (rest.length) parts.push(rest.map(([name, size]) => fill(said.share, { name: withWay(bodyOf(name), [name]), share: percent(size) })).join(", "));
  if (others.length) parts.push(`${listed(bodiesOf(others).map((body) => withWay(body, others)))} ${does("still", bodiesOf(others))}`);
  const [most, share] = Object.entries(mode.energy).map(([name, own]) => /** @type {[string, number]} */ ([name, Math.round(1000 * own) / 1000])).reduce((a, b) => (b[1] > a[1] ? b : a), ["", 0]);
  return parts.join(", ") + (most ? fill(said.energy, { share: percent(share), name: most.slice(most.indexOf(".") + 1) }) : "");
}
