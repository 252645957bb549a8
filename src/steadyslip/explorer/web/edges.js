// The nearest edge of every parameter, and where one lands that goes there.
import { ABSENT, STABLE, UNKNOWN } from "./linear.js";
import { inside } from "./rig.js";

export const BESIDE = 1e-3; // how far from an edge one lands that goes there, of its value

/**
 * The nearest edge of every parameter, the most urgent first: where, what is behind it, whether it is far off, and values
 * close to it: the landing on its stable side (on the one that slides steadily, where none is stable), and one behind it.
 * @param {import("./page.js").Page} page
 */
export function edgesOf(page) {
  const { remote } = page.rig.data; // times a value, beyond which an edge is of little use
  const found = /** @type {{i: number, at: number, distance: number, beyond: number, far: boolean, landing: number, behind: number}[]} */ ([]);
  page.rig.data.parameters.forEach((one, i) => {
    const value = page.rig.values[i], { edges, low, high } = page.found[i];
    let best = null;
    edges.forEach(({ at, below, above }, n) => {
      const away = at > value;
      if (below === UNKNOWN || above === UNKNOWN) return; // there is no rig to go to
      const [here, beyond] = away ? [below, above] : [above, below];
      const distance = one.unit === "rad" ? Math.abs(at - value) : Math.abs(at - value) / (Math.abs(value) || 1e300);
      if (best !== null && distance >= best.distance && (value || at >= best.at)) return;
      const times = Math.abs(value / at), far = one.unit !== "rad" && Boolean(value && at) && !(times < remote && times > 1 / remote);
      const across = beyond === STABLE || (beyond !== ABSENT && here !== STABLE); // whether that side is behind the edge
      const room = (up) => (up ? (edges[n + 1]?.at ?? high) : (edges[n - 1]?.at ?? low)) - at;
      best = { i, at, distance: value ? distance : 1e6, beyond, far, landing: beside(page, i, at, room(away === across)), behind: beside(page, i, at, room(away)) };
    });
    if (best) found.push(best);
  });
  return found.sort((a, b) => a.distance - b.distance);
}

/** A value close to an edge, on the side that has so much room: written with few digits, if it is there so. */
function beside(page, i, at, room) {
  const own = Math.abs(at || page.rig.values[i]), near = at + Math.sign(room) * Math.min(BESIDE * own || Math.abs(room), 0.5 * Math.abs(room)), round = page.rounded(i, near, 5);
  return Math.abs(round - near) < 0.5 * Math.abs(near - at) && inside(page.rig.data.parameters[i], round) ? round : near;
}
