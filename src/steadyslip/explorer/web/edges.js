// Nearest edge of every parameter, and values just beside it.
import { ABSENT, STABLE, UNKNOWN, isQuiet } from "./linear.js";
import { about, doublings } from "./nearness.js";
import { inside } from "./rig.js";
import { NEXT_TO_IT } from "./words.js";

export const BESIDE = 1e-3; // distance from an edge of the value set by "go there", over the value at the edge
const TIED = 6; // digits to which distances are compared, as in steadyslip/linear/boundary.py

/**
 * Nearest edge of every parameter, nearest first and far ones last: value, status behind it, far or not, and two values close to it:
 * `landing` on its stable side (or the side with steady sliding, if none is stable), and `behind` on its other side; `other` is the edge on the other side of the value.
 * @param {import("./page.js").Page} page
 */
export function edgesOf(page) {
  const most = Math.log2(page.rig.data.remote); // doublings from the own value from which an edge counts as far
  const found = /** @type {{i: number, at: number, gap: number, stable: string, distance: number, beyond: number, far: boolean, landing: number, behind: number, other?: number}[]} */ ([]);
  page.rig.data.parameters.forEach((one, i) => {
    const value = page.rig.values[i], { edges, low, high } = page.found[i];
    const [edge, other] = about(edges.filter(({ below, above }) => below !== UNKNOWN && above !== UNKNOWN), (one) => one.at, value, one.unit); // with a valid rig on both sides
    if (!edge) return;
    const { at, below, above } = edge, n = edges.indexOf(edge), away = at > value, [here, beyond] = away ? [below, above] : [above, below], doubled = doublings(value, at, one.unit);
    const isFar = (end) => one.unit !== "rad" && doublings(value, end) >= most;
    const across = isQuiet(beyond) || (beyond !== ABSENT && !isQuiet(here)); // true if the side to land on is behind the edge
    const room = (up) => (up ? (edges[n + 1]?.at ?? high) : (edges[n - 1]?.at ?? low)) - at;
    found.push({ i, at, gap: Math.abs(at - value), stable: above === STABLE ? "above" : below === STABLE ? "below" : "", distance: !value && one.unit !== "rad" ? Infinity : doubled > NEXT_TO_IT ? Number(doubled.toPrecision(TIED)) : 0, beyond, far: isFar(at), landing: beside(page, i, at, room(away === across)), behind: beside(page, i, at, room(away)), other: other && !isFar(other.at) ? other.at : undefined });
  });
  return found.sort((a, b) => Number(a.far) - Number(b.far) || a.distance - b.distance || 0);
}

/** Value close to an edge, on the side given by the sign of `room` (its distance to the next edge), with few digits. */
function beside(page, i, at, room) {
  const own = Math.abs(at || page.rig.values[i]), near = at + Math.sign(room) * Math.min(BESIDE * own || Math.abs(room), 0.5 * Math.abs(room)), round = page.rounded(i, near, 5);
  return Math.abs(round - near) < 0.5 * Math.abs(near - at) && inside(page.rig.data.parameters[i], round) ? round : near;
}
