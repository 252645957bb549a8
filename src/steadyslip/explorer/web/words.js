// What answers and motions are called: the sentences of the page.
import { ABSENT, STABLE, UNKNOWN } from "./linear.js";
import { fill } from "./modes.js";
import { digits, shown, told } from "./quantities.js";
import { NEW } from "./rig.js";

/** A stress, or a force where the rig has an area. */
export function quantity(value, unit, area, many = 4) {
  if (area !== null && unit === "Pa/m") return shown(value * area, "N/m", many);
  return area !== null && unit === "Pa" ? shown(value * area, "N", many) : shown(value, unit, many);
}

/** A name or a meaning with the word that fits: of what is given as a force, no stress. @param {string} text @param {string} unit */
export const named = (text, unit) => (unit[0] === "N" ? text.replace(/stress(es)?/g, (_, many) => (many ? "forces" : "force")) : text);

/** What the mechanism gives back in a slip event, which is less than nothing where it slides backwards. */
export const dropped = (value, unit, area = /** @type {number | null} */ (null)) => (value < 0 ? `${quantity(-value, unit, area)} (rises)` : quantity(value, unit, area));

/** How a stiffness along the sliding is told: in the unit of the user's file, where that gives one. @param {any} data */
export function asStiffness({ parameters, stiffness, area }) {
  const unit = area === null ? "Pa/m" : "N/m", given = parameters.find((one) => one.name === stiffness);
  return { unit, factor: area ?? 1, own: given?.unit === unit ? given.own : NEW };
}

/** What an answer is, in a word that style sheets know. */
export function kindOf(answer) {
  if (answer.status === ABSENT) return "none";
  if (answer.status === UNKNOWN) return "unknown";
  return answer.onEdge ? "edge" : answer.status === STABLE ? "stable" : "unstable";
}

/** The sentence. @param {string} speed "at" or "of" what */
export function headline(answer, speed) {
  return {
    none: `No steady sliding ${speed}`, unknown: "Numbers outside what a rig can have", edge: `On the edge of stability: steady sliding ${speed}`,
    stable: `Stable: steady sliding ${speed}`, unstable: `Unstable: steady sliding ${speed}`,
  }[kindOf(answer)];
}

/** Why. @param {any} answer @param {any} data */
export function reason(answer, data) {
  if (answer.status === ABSENT) {
    if (answer.slope >= 1) return `Lock-up: the pull raises friction by more than itself (1 − μ dσ/dτ is ${digits(1 - answer.slope)}, must be above 0).`;
    return answer.load <= 0 ? "Lift-off: the motion takes away more normal stress than the contact has." : "No positive normal stress satisfies the contact law at the steady shear stress.";
  }
  if (answer.status === UNKNOWN) return "A number leaves its range, or breaks a condition that several obey together.";
  if (answer.illPosed) return "The equations are ill-posed here: the model misses an inertia or a direct effect that matters.";
  const { critical, gain, share } = answer, one = asStiffness(data), stiffness = (k) => told(one, k);
  if (critical === null) return answer.intervals.length ? (gain > 0 ? `Stable whatever the stiffness beside the gain, ${stiffness(gain)}.` : "Stable at every stiffness.") : "No stiffness makes this sliding stable.";
  const total = answer.stiffness + gain, edge = critical + gain, by = gain && !answer.stiffness ? "gain" : "stiffness"; // what holds it
  const what = gain ? (answer.stiffness ? "Stiffness and gain together, " : `The gain ${data.stiffness?.replace(/.*\./, "")}, `) : "The stiffness ", are = gain ? (answer.stiffness ? ", are" : ", is") : " is";
  const alone = answer.intervals.length === 1 && (answer.side === "above" ? answer.intervals[0].high === Infinity : answer.intervals[0].low === 0);
  const period = answer.frequency ? ` At the critical ${by} a small disturbance oscillates, without growing or dying, with a period of ${shown((2 * Math.PI) / answer.frequency, "s").replace(" ", "\u00a0")}.` : "";
  const along = data.axial >= 0 ? ` (${stiffness(edge / share)} along the axis)` : "";
  const tail = alone ? `, ${answer.side} which sliding is stable.${period}` : `, the nearest edge of what is stable.${period}`;
  return `${what}${stiffness(total)}${are} ${ratio(total / edge)} times the critical ${stiffness(edge)}${along}${tail}`;
}

/** What is said of a machine: what becomes of disturbances, and the nearest edge. @param {any} answer @param {any} data @param {any} [edge] */
export function machineReason(answer, { phrases, beyond, facts, areas }, edge) {
  const sentence = (text) => text[0].toUpperCase() + text.slice(1) + ".";
  if (answer.status === UNKNOWN) return "A number leaves its range, or breaks a condition that several obey together.";
  if (answer.status === ABSENT) {
    const { absent } = phrases, at = fill(absent.at, { name: facts.contacts[answer.contact] }), area = areas[answer.contact] < 0 ? 1 : answer.own[areas[answer.contact]];
    const force = (stress) => shown(stress * area, "N");
    if (answer.searched) return sentence(fill(absent["no solution"], { force: "force", at }));
    if (answer.pressing !== undefined) return sentence(answer.pressing < 1 ? fill(absent.lifted, { at, left: force(answer.load) }) : fill(absent.together, { at, margin: digits(1 - answer.pressing) }));
    if (!(answer.slope < 1)) return sentence(fill(absent["lock-up"], { at, margin: digits(1 - answer.slope) }));
    return sentence(fill(absent["lift-off"], { at, force: "force", load: force(answer.had), taken: force(answer.had - answer.load), left: force(answer.load) }));
  }
  if (answer.illPosed) return sentence(phrases["are ill-posed"]);
  if (answer.onEdge) return sentence(phrases["on edge"]);
  const what = answer.status === STABLE ? phrases["dies out"] : beyond[kindBeyond(answer)];
  return sentence(edge ? `${what}; ${fill(phrases.nearest, edge)}` : what);
}

/** What kind of change an edge is, by what is behind it where that is not stable. @param {any} answer there */
function kindBeyond(answer) {
  if (answer.status === ABSENT) return answer.searched ? "no solution" : (answer.pressing ?? answer.slope) < 1 ? "lift-off" : "lock-up";
  return answer.illPosed ? "ill-posed" : answer.eigenvalues[0]?.im ? "oscillatory" : "divergence";
}

/** "it lifts off" of a machine: which contact does. @param {string} words @param {any} answer @param {any} facts */
const ofContact = (words, answer, { contacts }) => (answer.status === ABSENT && contacts[answer.contact] ? words.replace(/^it /, `${contacts[answer.contact]} `) : words);

/** What happens beyond an edge, in the words of Python; where nothing slides steadily before it, what does behind. @param {any} edge @param {any} page */
export function beyondWords({ i, beyond, behind }, page) {
  if (beyond === STABLE) return "becomes stable";
  if (beyond !== ABSENT && page.answer.status === ABSENT) return "slides steadily, but unstable";
  const answer = page.rig.assess(page.with(i, behind)), { beyond: words, facts } = page.rig.data;
  return ofContact(words[kindBeyond({ ...answer, status: beyond })], answer, facts);
}

/** How many times something is something else: with as many digits as tell it from once. */
const ratio = (many) => digits(many, Math.min(8, Math.max(3, 1 - Math.floor(Math.log10(Math.abs(many - 1) || 1)))));

/** How a motion ends before its time, where the driver has a word of its own for it. @type {Record<string, string>} */
const ENDED = {
  "no velocity": "no velocity balances the forces", "contact lost": "the contact is lost, its normal force has fallen to zero",
  stuck: "no step is small enough, as the equations have no solution beyond", "too many steps": "more steps than a page takes; ask for a shorter time, or steadyslip simulate, which takes more",
};

/** A velocity, unless it is so small that nothing moves. @param {number} v @param {number} floor */
export const slow = (v, floor) => (Math.abs(v) < floor ? "0 (stuck)" : shown(v, "m/s", 3));

/** What came of a motion. @param {any} course @param {any} data */
export function outcome({ events, status, end, contacts, at }, { area, phrases }) {
  if (status === "blow-up") return `It runs away at ${shown(end, "s")}, ${shown(end - at, "s")} after the disturbance: neither mass nor damping limits the velocity.`;
  const ended = status === "done" ? "" : ` It ends at ${shown(end, "s")}: ${ENDED[status] ?? status}.`;
  if (!events.length) {
    const ranges = contacts.map(({ name, v, floor }) => {
      const least = v.reduce((a, b) => Math.min(a, b), Infinity), most = v.reduce((a, b) => Math.max(a, b), -Infinity);
      return `${name ? `${name} ` : ""}${slow(least, floor)} to ${slow(most, floor)}`;
    });
    return `No slip event; ${phrases ? "slip rate of " : "velocity "}${ranges.join(", of ")}.${ended}`;
  }
  const last = events[events.length - 1], before = events.slice(0, -1).findLast((one) => one.contact === last.contact);
  const every = before ? `, the last two${phrases ? ` of ${last.contact}` : ""} ${shown(last.begin - before.begin, "s", 3)} apart` : "";
  const counts = contacts.map(({ name }) => [events.filter((one) => one.contact === name).length, name]).filter(([many]) => many);
  const where = phrases ? ` (${counts.map(([many, name]) => (counts.length > 1 ? `${many} of ${name}` : name)).join(", ")})` : "";
  const what = `${phrases || area !== null ? "force" : "stress"} ${last.drop < 0 ? "rise" : "drop"}`, drop = `${what} ${phrases ? shown(Math.abs(last.drop), "N") : quantity(Math.abs(last.drop), "Pa", area)}`;
  return `${events.length} slip event${events.length > 1 ? "s" : ""}${where}${every}; the last: peak ${shown(last.peak, "m/s", 3)}, ${drop}.${ended}`;
}
