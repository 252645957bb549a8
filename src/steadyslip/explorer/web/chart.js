// Stability chart over two parameters: regions filled row by row, outlines by marching squares.
import { ABSENT, STABLE, UNKNOWN, UNSTABLE } from "./linear.js";

export const CLASSES = { [ABSENT]: "none", [STABLE]: "stable", [UNSTABLE]: "unstable", [UNKNOWN]: "unknown" };

/**
 * SVG paths of the regions, of the outlines between them (`lost` where there is no steady sliding on one side), and places for words.
 * @param {(x: number, y: number) => number} status of positions from 0 to 1
 * @param {number} rows
 */
export function regions(status, rows, width, height) {
  const columns = Math.round(rows * 1.3), grid = [];
  const paths = { stable: "", unstable: "", none: "", unknown: "" };
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
  return { paths, outline, lost, places: widest(grid, width / columns, height / rows) };
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

const STEEP = 0.15, HALVINGS = 8; // STEEP: difference between neighbours beyond which a crossing is searched for; HALVINGS: of a cell

/**
 * SVG path of the line of a level over a grid of numbers, straight within its cells, and the middles of its pieces; none in cells with a `jump`.
 * @param {number[][]} grid @param {number} at @param {((x: number, y: number) => number) | null} [exact] numbers at positions from 0 to 1
 */
export function line(grid, at, width, height, jump = Infinity, exact = null) {
  const rows = grid.length - 1, columns = grid[0].length - 1, middles = /** @type {[number, number][]} */ ([]);
  let path = "";
  for (let j = 0; j < rows; j++) {
    for (let i = 0; i < columns; i++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]], values = corners.map(([x, y]) => grid[y][x]);
      if (Math.max(...values) - Math.min(...values) > jump) continue;
      const ends = corners.flatMap(([x, y], k) => {
        const [u, v] = corners[(k + 1) % 4], a = values[k] - at, b = values[(k + 1) % 4] - at;
        let t = a / (a - b);
        if (exact && a * b < 0 && Math.abs(a - b) > STEEP) {
          t = 0.5;
          for (let n = 2; n <= HALVINGS; n++) t += ((exact((x + t * (u - x)) / columns, (y + t * (v - y)) / rows) - at) * a > 0 ? 1 : -1) / 2 ** n;
        }
        return a * b < 0 ? [[((x + t * (u - x)) / columns) * width, (1 - (y + t * (v - y)) / rows) * height]] : [];
      });
      if (ends.length !== 2) continue;
      path += `M${ends.map((one) => one.map((v) => v.toFixed(1)).join(" ")).join("L")}`;
      middles.push([0.5 * (ends[0][0] + ends[1][0]), 0.5 * (ends[0][1] + ends[1][1])]);
    }
  }
  return { path, middles };
}

const HALF_LINE = 11, HALF_LETTER = 4.2; // half the height of a line and half the width of a letter of words in areas, SVG units

/** Places for the words of the areas: where they are furthest from all outlines, if there is room. @param {number[][]} grid of statuses */
function widest(grid, dx, dy) {
  const rows = grid.length, columns = grid[0].length;
  return [...new Set(grid.flat())].flatMap((code) => {
    const name = CLASSES[code], across = dx / (HALF_LETTER * (name === "none" ? 17 : 9)), up = dy / HALF_LINE, away = grid.map((row) => row.map((one) => (one === code ? Infinity : 0)));
    const near = (j, i) => (j < 0 || i < 0 || j >= rows || i >= columns ? 0 : away[j][i]);
    for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) away[j][i] = Math.min(away[j][i], near(j, i - 1) + across, near(j - 1, i) + up);
    let best = 1, at = null;
    for (let j = rows - 1; j >= 0; j--) {
      for (let i = columns - 1; i >= 0; i--) {
        away[j][i] = Math.min(away[j][i], near(j, i + 1) + across, near(j + 1, i) + up);
        if (away[j][i] > best) [best, at] = [away[j][i], { name, x: i * dx, y: (rows - 1 - j) * dy }];
      }
    }
    return at ? [at] : [];
  });
}
