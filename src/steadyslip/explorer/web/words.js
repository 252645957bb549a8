// Sentences of the page about verdicts and motions.
import { ABSENT, CLASSES, SAME, STABLE, UNDAMPED, UNKNOWN, UNSTABLE } from "./linear.js";
import { fill } from "./modes.js";
import { extent } from "./plot.js";
import { digits, shown, told } from "./quantities.js";
import { NEW } from "./rig.js";

/** Text of a stress, or of a force for rigs with an area. */
export function quantity(value, unit, area, many = 4) {
  return area !== null && unit === "Pa" ? shown(value * area, "N", many) : shown(value, unit, many);
}

/** Name or meaning with "force" for "stress" if the unit is one of force. @param {string} text @param {string} unit */
export const named = (text, unit) => (unit[0] === "N" ? text.replace(/stress(es)?/g, (_, many) => (many ? "forces" : "force")) : text);

/** Parameter data with which a stiffness along the slide is shown: in the unit of the user's file if it has one. @param {any} data */
export function asStiffness({ parameters, stiffness, stiffnessArea: area }) {
  const unit = area === null ? "Pa/m" : "N/m", given = parameters.find((one) => one.name === stiffness);
  return { unit, factor: area ?? 1, own: given?.unit === unit ? given.own : NEW };
}

/** Kind of an answer, as a word used by the style sheet. */
export function kindOf(answer) {
  return answer.onEdge && answer.status !== UNDAMPED ? "edge" : CLASSES[answer.status];
}

/** Text that begins with a capital letter. @param {string} text */
const begun = (text) => text[0].toUpperCase() + text.slice(1);
export const NEXT_TO_IT = 1e-6; // relative distance from the edge that counts as on it; as in steadyslip/verdict/reasons.py, whose phrases are used here

/** Headline of the verdict. @param {string} speed velocity with its preposition */
export const headline = (answer, speed, { headlines }) => fill(headlines[kindOf(answer)].join(""), { speed });

/** Words for a kind of answer, such as those in the areas of the chart. @param {string} kind @param {any} data */
export const kindWords = (kind, { headlines }) => headlines[kind][0].toLowerCase();

/** Reason for the verdict, with the phrases of Python. @param {any} answer @param {any} data @param {any} [edge] nearest edge of a machine */
export function reason(answer, data, edge) {
  const { phrases, reasons } = data, words = phrases ?? reasons;
  const text = answer.status === UNKNOWN ? data.absent.unfit : answer.status === ABSENT ? absence(answer, data) : answer.illPosed ? words["are ill-posed"] : phrases ? ofMachine(answer, data, edge) : ofSlider(answer, data);
  return `${begun(text)}.`;
}

/** Reason why there is no steady sliding. */
function absence(answer, { absent, phrases, facts, areas, area }) {
  const name = facts.contacts[answer.contact], at = name ? fill(absent.at, { name }) : "";
  const whole = !phrases ? area : areas[answer.contact] < 0 ? 1 : answer.own[areas[answer.contact]];
  const force = whole === null ? "stress" : "force", size = (stress) => quantity(stress, "Pa", whole);
  if (answer.searched) return fill(absent["no solution"], { force, at });
  if (answer.pressing !== undefined) return answer.pressing < 1 ? fill(absent.lifted, { at, left: size(answer.load) }) : fill(absent.together, { at, margin: digits(1 - answer.pressing) });
  if (!(answer.slope < 1)) return fill(absent["lock-up"] + absent.hints[answer.contact], { at, margin: digits(1 - answer.slope), inverse: digits(1 / answer.friction), angle: digits(Math.atan2(1, answer.friction) * 180 / Math.PI) });
  return fill(absent["lift-off"], { at, force, load: size(answer.had), taken: size(answer.had - answer.load), left: size(answer.load) });
}

/** Reason for the verdict on a slider away from its critical value. */
function ofSlider({ onEdge, eigenvalues, stiffness, gain, held, intervals, critical, side }, data) {
  const { reasons } = data, say = (k) => told(asStiffness(data), k), own = stiffness + gain, name = held ? reasons.name : "stiffness";
  if (onEdge && !own && eigenvalues.some(({ re, im }) => !re && !im)) return reasons.free;
  if (held) ({ intervals, critical, side } = held);
  const edge = critical === null ? NaN : held ? critical : critical + gain, many = own / edge;
  if (onEdge && !(Math.abs(many - 1) <= NEXT_TO_IT)) return reasons["on edge"];
  if (critical === null) return intervals.length && gain && !held ? reasons.beside : fill(reasons[intervals.length ? "always" : "never"], { name });
  const text = fill(reasons[held ? "gain" : gain && stiffness ? "together" : "stiffness"], { name: reasons.name, own: say(own), ratio: onEdge ? reasons["at it"] : fill(reasons.times, { many: ratio(many) }), critical: say(edge) });
  const alone = intervals.length === 1 && (side === "above" ? intervals[0].high === Infinity : intervals[0].low === 0);
  return text + (alone ? fill(reasons["one edge"], { side }) : reasons.several) + (onEdge ? `; ${reasons["on edge"]}` : "");
}

/** Sentences on the critical value of a slider. */
export function besides({ critical, illPosed, frequency, gain, share }, data) {
  if (critical === null || illPosed) return "";
  const rows = [["along the axis", data.axial >= 0, { critical: told(asStiffness(data), (critical + gain) / share) }], ["at the edge", frequency, { period: shown((2 * Math.PI) / frequency, "s") }]];
  return rows.filter(([, there]) => there).map(([label, , holes]) => ` ${begun(label)}: ${fill(data.reasons[label], holes)}.`).join("");
}

/** Reason for the verdict on a machine: growth or decay, and the nearest edge. */
function ofMachine(answer, { phrases, beyond }, edge) {
  if (kindOf(answer) === "edge") return phrases["on edge"];
  const what = answer.status === STABLE ? phrases["dies out"] : answer.status === UNDAMPED ? phrases.undamped : beyond[kindBeyond(answer)];
  return edge ? `${what}; ${fill(phrases.nearest, edge)}` : what;
}

/** Kind of an edge, from the answer on its unstable side. @param {any} answer on that side */
function kindBeyond(answer) {
  if (answer.status === ABSENT) return answer.searched ? "no solution" : (answer.pressing ?? answer.slope) < 1 ? "lift-off" : "lock-up";
  return answer.illPosed ? "ill-posed" : answer.eigenvalues[0]?.im ? "oscillatory" : "divergence";
}

/** Phrase such as "it lifts off" with the name of the contact of a machine. @param {string} words @param {any} answer @param {any} facts */
const ofContact = (words, answer, { contacts }) => (answer.status === ABSENT && contacts[answer.contact] ? words.replace(/^it /, `${contacts[answer.contact]} `) : words);

/** Phrase for an edge in the list, as in Python. @param {any} edge @param {any} page */
export function edgeWords(edge, page) {
  const { answer, rig: { values, data: { beyond } } } = page, { i, gap, stable } = edge;
  if (answer.onEdge && gap <= NEXT_TO_IT * Math.abs(values[i])) return stable ? fill(beyond.beside, { side: stable }) : beyond.here;
  return beyondWords(edge, page);
}

/** Phrase for what happens beyond an edge. @param {any} edge @param {any} page */
export function beyondWords({ i, at, beyond, behind }, page) {
  const { answer: now, rig: { data: { beyond: words, facts } } } = page;
  if (beyond === STABLE) return words.stable;
  if (beyond === UNDAMPED) return words.quiet;
  if (beyond !== ABSENT && now.status === ABSENT) return words.unstable;
  const there = (value) => page.rig.assess(page.with(i, value)), answer = there(behind);
  if (beyond === ABSENT) return ofContact(words[kindBeyond({ ...answer, status: beyond })], answer, facts);
  const step = SAME * Math.abs(at) || Math.abs(behind), below = there(at - step), above = there(at + step); // decided at the edge, as in steadyslip/linear/search.py
  const growing = [below, above].find(({ status }) => status === UNSTABLE);
  if ([below, above].some(({ status }) => status === UNDAMPED)) return words[growing?.eigenvalues[0].im ? "coupling" : "divergence"];
  if (below.illPosed !== above.illPosed) return words["ill-posed"];
  return words[below.still * above.still > 0 && below.eigenvalues.some(({ im }) => im) ? "oscillatory" : "divergence"];
}

/** Text of a ratio, with enough digits to differ from 1. */
const ratio = (many) => digits(many, Math.min(8, Math.max(3, 1 - Math.floor(Math.log10(Math.abs(many - 1) || 1)))));

/** Text of a velocity; "0 (stuck)" below the floor. @param {number} v @param {number} floor */
export const slow = (v, floor) => (Math.abs(v) < floor ? "0 (stuck)" : shown(v, "m/s", 3));

/** Text of what a slip event sheds: a stress or force, of a contact at a radius (`lever`) a torque. @param {number} value @param {any} contact @param {any} data */
export function shed(value, contact, { area, phrases }, many = 4) {
  if (!phrases) return quantity(value, "Pa", area, many);
  return contact?.lever ? shown(value * contact.lever, "N m", many) : shown(value, "N", many);
}

/** Sentence on the result of a motion. @param {any} course @param {any} data */
export function outcome({ events, status, end, contacts, at }, { area, phrases, judders, ends, pulls }) {
  const cause = `${ends[status] ?? status}${status === "too many steps" ? "; ask for a shorter time, or steadyslip simulate, which takes more" : ""}`;
  if (status === "blow-up") return `It runs away at ${shown(end, "s")} (last dashed line), ${shown(end - at, "s")} after the disturbance: ${cause}.`;
  const ended = status === "done" ? "" : ` It ends ${end === at ? "with the disturbance, " : ""}at ${shown(end, "s")}: ${cause}.`;
  if (!(end > 0) || !contacts[0].v.length) return `No motion: it ends as it begins: ${cause}.`;
  if (!events.length) {
    const ranges = contacts.map(({ name, v, floor }) => {
      const [least, most] = extent(v);
      return `${name ? `${name} ` : ""}${slow(least, floor)} to ${slow(most, floor)}`;
    });
    return `No slip event; ${phrases ? "slip rate of " : "velocity "}${ranges.join(", of ")}.${ended}`;
  }
  const last = events[events.length - 1], before = `, the last two${phrases ? ` of ${last.contact}` : ""} ${shown(last.every, "s", 3)} apart`;
  const every = last.every !== null ? before : "";
  const counts = contacts.map(({ name }) => [events.filter((one) => one.contact === name).length, name]).filter(([many]) => many);
  const where = phrases ? ` (${counts.map(([many, name]) => (counts.length > 1 ? `${many} of ${name}` : name)).join(", ")})` : "";
  const of = (name) => contacts.find((one) => one.name === name), dropped = (value, name, many) => shed(value, of(name), { area, phrases }, many);
  const drop = `${phrases && of(last.contact)?.lever ? "torque" : phrases || area !== null ? "force" : "stress"} drop ${dropped(last.drop, last.contact)}`;
  const told = counts.map(([, name]) => sentence(events.filter((one) => one.contact === name), judders, (value) => fill(pulls?.[name] ? judders.of : "{drop}", { drop: dropped(value, name, 3), pull: pulls?.[name] }), end)).map((text, i) => `${phrases ? counts[i][1] : "it"} ${text}`);
  return `${events.length} slip event${events.length > 1 ? "s" : ""}${where}${every}; the last: peak ${shown(last.peak, "m/s", 3)}, ${drop}; ${told.join("; ")}.${ended}`;
}

/** Sentence on the slip events of one contact, as in Python (steadyslip.motion.sentence). @param {any} slips @param {Record<string, any>} words @param {(value: number) => string} force @param {number} until */
function sentence(slips, words, force, until) {
  const back = slips.filter((one) => one.slip < 0), last = slips.findLast((one) => one.slip > 0) ?? back[back.length - 1], { rings } = last, hindmost = back[back.length - 1];
  const late = slips.filter((one) => one.slip > 0 && one.begin > 0.5 * until && one.every !== null).map((one) => one.every);
  const over = last.every !== null && until - last.end > words.recurrences * Math.max(last.every, ...late);
  const text = words[over ? "over" : last.every !== null ? "again" : "alone"] + (rings.length > 1 ? words.rings : "") + (hindmost ? words.backward : "");
  return fill(text, {
    every: shown(last.every, "s", 3), waits: words[last.sticks ? "sticks" : "lags"], slip: shown(Math.abs(last.slip), "m", 3), within: shown(last.end - last.begin, "s", 3),
    drop: force(last.drop), rings: `${rings.length}`, often: rings.length > 1 ? shown(1 / (rings[rings.length - 1] - rings[rings.length - 2]), "Hz", 3) : "",
    count: `${slips.filter((one) => one.slip > 0).length}`, ended: shown(last.end, "s", 3), backward: `${back.length}`, back: hindmost ? shown(Math.abs(hindmost.slip), "m", 3) : "", during: hindmost ? shown(hindmost.end - hindmost.begin, "s", 3) : "",
  });
}
