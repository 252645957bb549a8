// Stability chart over two parameters: regions filled row by row, outlines by marching squares.
import { ABSENT, CLASSES } from "./linear.js";

/**
 * SVG paths of the regions, of the outlines between them (`lost` where there is no steady sliding on one side), and places for words
 * that are clear of the point `own`.
 * @param {(x: number, y: number) => number} status of positions from 0 to 1
 * @param {number} rows @param {number} width @param {number} height @param {number[]} own
 */
export function regions(status, rows, width, height, own) {
  const columns = Math.round(rows * 1.3), grid = [];
  const paths = Object.fromEntries(CLASSES.map((name) => [name, ""]));
  const cut = (at, a, b, first) => { // boundary point between two positions of different status, by bisection
    for (let step = 0; step < 10; step++) {
      const middle = 0.5 * (a + b);
      if (at(middle) === first) a = middle;
      else b = middle;
    }
    return 0.5 * (a + b);
  };
  for (let j = 0; j <= rows; j++) grid.push(Array.from({ length: columns + 1 }, (_, i) => status(i / columns, j / rows)));
  const top = (y) => ((1 - y) * height).toFixed(1), left = (x) => (x * width).toFixed(1);
  const border = /** @type {number[][]} */ ([]); // middles of the pieces of both outlines
  let outline = "", lost = "";
  const acrossRow = (j, i) => cut((x) => status(x, j / rows), i / columns, (i + 1) / columns, grid[j][i]);
  const upColumn = (j, i) => cut((y) => status(i / columns, y), j / rows, (j + 1) / rows, grid[j][i]);
  for (let j = 0; j < rows; j++) {
    for (let i = 0; i < columns; i++) {
      const a = grid[j][i], b = grid[j][i + 1], c = grid[j + 1][i + 1], d = grid[j + 1][i];
      if (a === b && b === c && c === d) continue;
      const points = [];
      if (a !== b) points.push([acrossRow(j, i), j / rows]);
      if (b !== c) points.push([(i + 1) / columns, upColumn(j, i + 1)]);
      if (d !== c) points.push([acrossRow(j + 1, i), (j + 1) / rows]);
      if (a !== d) points.push([i / columns, upColumn(j, i)]);
      const mean = (which) => points.reduce((sum, point) => sum + point[which], 0) / points.length; // more than two crossings: regions meet in the middle
      const ends = points.length === 3 ? points.flatMap((point) => [point, [mean(0), mean(1)]]) : points;
      for (let k = 0; k + 1 < ends.length; k += 2) {
        const piece = `M${left(ends[k][0])} ${top(ends[k][1])}L${left(ends[k + 1][0])} ${top(ends[k + 1][1])}`;
        border.push([0.5 * (ends[k][0] + ends[k + 1][0]) * width, (1 - 0.5 * (ends[k][1] + ends[k + 1][1])) * height]);
        if ([a, b, c, d].includes(ABSENT)) lost += piece;
        else outline += piece;
      }
    }
  }
  const fine = 2 * rows;
  for (let j = 0; j < fine; j++) {
    const y = (j + 0.5) / fine, low = grid[j >> 1], high = grid[(j >> 1) + 1];
    const high_ = top((j + 1) / fine), low_ = top(j / fine);
    const bar = (a, b, code) => { // half a pixel into the next row, so that there is no seam
      paths[CLASSES[code]] += `M${left(a)} ${high_}H${left(b)}V${(Number(low_) + 0.5).toFixed(1)}H${left(a)}Z`;
    };
    if (low.every((s, i) => s === low[0] && high[i] === low[0])) {
      bar(0, 1, low[0]);
      continue;
    }
    // a cell whose corners have one status is filled with it
    let from = 0, code = low[0] === high[0] ? low[0] : status(0, y);
    for (let i = 0; i < columns; i++) {
      const same = low[i + 1] === high[i + 1], next = same ? low[i + 1] : status((i + 1) / columns, y);
      if (next === code) continue;
      const x = cut((one) => status(one, y), i / columns, (i + 1) / columns, code);
      bar(from, x, code);
      [from, code] = [x, next];
    }
    bar(from, 1, code);
  }
  return { paths, outline, lost, border, places: widest(grid, width / columns, height / rows, own) };
}

/** Grid of numbers carried on by one point into NaN, in straight lines. @param {number[][]} grid */
export function carried(grid) {
  return grid.map((row, j) => row.map((one, i) => {
    if (!Number.isNaN(one)) return one;
    const near = [-1, 0, 1].flatMap((v) => [-1, 0, 1].map((u) => [grid[j + v]?.[i + u], grid[j + 2 * v]?.[i + 2 * u]])).filter(([a]) => Number.isFinite(a));
    const along = near.filter(([, b]) => Number.isFinite(b)), ends = along.length ? along.map(([a, b]) => 2 * a - b) : near.map(([a]) => a);
    return ends.reduce((sum, end) => sum + end, 0) / ends.length;
  }));
}

const STEEP = 0.15, TRIES = 8; // STEEP: difference between neighbours beyond which a crossing is searched for; TRIES: of a search

/** Position from 0 to 1 at which a function with ends `a` and `b` of either sign is zero, by false position (Illinois). */
function zero(f, a, b, steps) {
  let low = 0, high = 1, t = a / (a - b);
  for (let n = 0, kept = 0; n < steps; n++) {
    const now = f(t);
    if (!now || !Number.isFinite(now)) return t;
    if (now * a > 0) {
      if (kept < 0) b /= 2;
      [low, a, kept] = [t, now, -1];
    } else {
      if (kept > 0) a /= 2;
      [high, b, kept] = [t, now, 1];
    }
    t = low + ((high - low) * a) / (a - b);
  }
  return t;
}

/**
 * SVG path of the line of a level over a grid of numbers, and the middles of its pieces; none in cells with a `jump`. It is straight
 * within cells, or with `exact`, numbers at positions from 0 to 1, crosses their sides where these are reached if they change by more
 * than `steep`; with `bends` in so many `steps` each, and with a vertex inside cells, which one step along the gradient finds.
 * @param {number[][]} grid @param {number} at @param {number} width @param {number} height
 * @param {{jump?: number, exact?: ((x: number, y: number) => number) | null, steep?: number, steps?: number, bends?: boolean}} [how]
 */
export function line(grid, at, width, height, { jump = Infinity, exact = null, steep = STEEP, steps = TRIES, bends = false } = {}) {
  const rows = grid.length - 1, columns = grid[0].length - 1, middles = /** @type {[number, number][]} */ ([]), known = /** @type {Record<string, number>} */ ({});
  const beyond = (x, y) => (exact ? exact(x / columns, y / rows) : NaN) - at, shown = ([x, y]) => [(x / columns) * width, (1 - y / rows) * height];
  let path = "";
  for (let j = 0; j < rows; j++) {
    for (let i = 0; i < columns; i++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]], values = corners.map(([x, y]) => grid[y][x] - at), [a, b, c, d] = values;
      if (Math.max(...values) - Math.min(...values) > jump) continue;
      const ends = [[0, 1], [1, 2], [3, 2], [0, 3]].flatMap(([k, l]) => {
        const [x, y] = corners[k], [u, v] = corners[l], one = values[k], other = values[l], side = `${[x, y, u]}`;
        if (!(one * other < 0)) return [];
        const t = known[side] ??= zero((share) => beyond(x + share * (u - x), y + share * (v - y)), one, other, exact && Math.abs(one - other) > steep ? steps : 0);
        return [[x + t * (u - x), y + t * (v - y)]];
      });
      const saddle = () => (exact ? beyond(i + 0.5, j + 0.5) : a + b + c + d) * a > 0; // two lines cross the cell: they part where its middle is
      const pieces = ends.length === 2 ? [ends] : ends.length < 4 ? [] : saddle() ? [ends.slice(0, 2), ends.slice(2)] : [[ends[0], ends[3]], ends.slice(1, 3)];
      for (const piece of pieces) {
        const [first, last] = piece, middle = [0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1])];
        if (bends) {
          const [u, v] = [middle[0] - i, middle[1] - j], gx = (1 - v) * (b - a) + v * (c - d), gy = (1 - u) * (d - a) + u * (c - b), far = beyond(middle[0], middle[1]), off = far / (gx * gx + gy * gy), x = middle[0] - off * gx, y = middle[1] - off * gy;
          if (Math.hypot(off * gx, off * gy) < 0.5 && Math.abs(beyond(x, y)) < 0.5 * Math.abs(far)) [middle[0], middle[1]] = [x, y];
        }
        path += `M${[first, ...(bends ? [middle] : []), last].map((one) => shown(/** @type {[number, number]} */ (one)).map((value) => value.toFixed(1)).join(" ")).join("L")}`;
        const [x, y] = shown(/** @type {[number, number]} */ (middle));
        middles.push([x, y]);
      }
    }
  }
  return { path, middles };
}

export const HALF_LINE = 11, HALF_LETTER = 4.2; // half the height of a line and half the width of a letter of words in areas, SVG units
export const POINT = 12; // radius of the rig's point with its halo, SVG units
const LETTERS = { none: 17 }; // of words, 9 of others

/** Places for the words of the areas, one in each area that has room: where they are furthest from all outlines and the point. @param {number[][]} grid of statuses @param {number} dx @param {number} dy @param {number[]} own */
function widest(grid, dx, dy, [left, top]) {
  const rows = grid.length, columns = grid[0].length, places = /** @type {{name: string, x: number, y: number, wide: number}[]} */ ([]);
  for (const code of new Set(grid.flat())) {
    const name = CLASSES[code], wide = HALF_LETTER * (LETTERS[name] ?? 9), across = dx / wide, up = dy / HALF_LINE;
    const covered = (j, i) => Math.abs(i * dx - left) < POINT + dx && Math.abs((rows - 1 - j) * dy - top) < POINT + dy;
    const named = new Uint8Array(rows * columns), free = grid.map((row, j) => row.map((one, i) => one === code && !covered(j, i)));
    for (let more = true; more; ) {
      const away = free.map((row) => row.map((one) => (one ? Infinity : 0))), near = (j, i) => away[j]?.[i] ?? 0;
      for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) away[j][i] = Math.min(away[j][i], near(j, i - 1) + across, near(j - 1, i) + up);
      let best = 1, at = /** @type {number[] | null} */ (null);
      for (let j = rows - 1; j >= 0; j--) {
        for (let i = columns - 1; i >= 0; i--) {
          away[j][i] = Math.min(away[j][i], near(j, i + 1) + across, near(j + 1, i) + up);
          if (away[j][i] > best) [best, at] = [away[j][i], [j, i]];
        }
      }
      more = at !== null;
      if (!at) continue;
      places.push({ name, x: at[1] * dx, y: (rows - 1 - at[0]) * dy, wide });
      for (const open = [at]; open.length; ) { // this area has its word
        const [j, i] = /** @type {number[]} */ (open.pop());
        if (grid[j]?.[i] !== code || named[j * columns + i]) continue;
        named[j * columns + i] = 1;
        free[j][i] = false;
        open.push([j, i - 1], [j, i + 1], [j - 1, i], [j + 1, i]);
      }
    }
  }
  return places;
}
