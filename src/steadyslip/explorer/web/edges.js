// Nearest edge of every parameter, and values just beside it.
import { ABSENT, STABLE, UNKNOWN } from "./linear.js";
import { inside } from "./rig.js";
import { NEXT_TO_IT } from "./words.js";

export const BESIDE = 1e-3; // distance from an edge of the value set by "go there", over the value at the edge
const TIED = 6; // digits to which distances are compared, as in steadyslip/linear/boundary.py

/**
 * Nearest edge of every parameter, nearest first and far ones last: value, status behind it, far or not, and two values close to it:
 * `landing` on its stable side (or the side with steady sliding, if none is stable), and `behind` on its other side.
 * @param {import("./page.js").Page} page
 */
export function edgesOf(page) {
  const { remote } = page.rig.data; // ratio to the own value above which an edge counts as far
  const found = /** @type {{i: number, at: number, gap: number, stable: string, distance: number, beyond: number, far: boolean, landing: number, behind: number}[]} */ ([]);
  page.rig.data.parameters.forEach((one, i) => {
    const value = page.rig.values[i], { edges, low, high } = page.found[i], size = one.unit === "rad" ? 1 : Math.abs(value);
    let best = null;
    edges.forEach(({ at, below, above }, n) => {
      const away = at > value;
      if (below === UNKNOWN || above === UNKNOWN) return; // no valid rig on one side
      const [here, beyond] = away ? [below, above] : [above, below];
      const gap = Math.abs(at - value);
      if (best !== null && gap >= best.gap) return;
      const times = Math.abs(value / at), far = one.unit !== "rad" && Boolean(value && at) && !(times < remote && times > 1 / remote);
      const across = beyond === STABLE || (beyond !== ABSENT && here !== STABLE); // true if the side to land on is behind the edge
      const room = (up) => (up ? (edges[n + 1]?.at ?? high) : (edges[n - 1]?.at ?? low)) - at;
      best = { i, at, gap, stable: above === STABLE ? "above" : below === STABLE ? "below" : "", distance: !size ? Infinity : gap > NEXT_TO_IT * size ? Number((gap / size).toPrecision(TIED)) : 0, beyond, far, landing: beside(page, i, at, room(away === across)), behind: beside(page, i, at, room(away)) };
    });
    if (best) found.push(best);
  });
  return found.sort((a, b) => Number(a.far) - Number(b.far) || a.distance - b.distance || 0);
}

/** Value close to an edge, on the side given by the sign of `room` (its distance to the next edge), with few digits. */
function beside(page, i, at, room) {
  const own = Math.abs(at || page.rig.values[i]), near = at + Math.sign(room) * Math.min(BESIDE * own || Math.abs(room), 0.5 * Math.abs(room)), round = page.rounded(i, near, 5);
  return Math.abs(round - near) < 0.5 * Math.abs(near - at) && inside(page.rig.data.parameters[i], round) ? round : near;
}
