// Disturbances of a rig: text, place, unit and usual size of each kind.
import { digits, parse, shown } from "./quantities.js";
import { named } from "./words.js";

/**
 * @typedef {{period: number, slip: number, on: string, answer: any, sliding: any[]}} Known
 * @typedef {{words: string, many?: string, kind: string, unit: (unit: string) => string, usual: (known: Known) => number, ratio?: boolean, positive?: boolean}} Disturbance
 */

const PERIODS = 12, BEFORE = 20; // PERIODS: length of a run in periods; BEFORE: the disturbance comes after 1/BEFORE of the run
const force = ({ answer, sliding }) => sliding.map((one, i) => answer.observed[`${one.name}.friction_force`] ?? answer.observed.shear_stress ?? answer.sigmas[i]);

/** @type {Record<string, Disturbance>} `many` is the text for machines, followed by the name of the body or contact */
export const DISTURBANCES = {
  velocity: { words: "step of the drive velocity", kind: "velocity-step", unit: () => "1", usual: () => 2, ratio: true },
  hold: { words: "hold of the load point", many: "hold of the drive", kind: "hold", unit: () => "s", usual: ({ period }) => period, positive: true },
  push: { words: "push of the load point", many: "push of the drive", kind: "displacement-step", unit: (own) => own, usual: ({ slip }) => slip },
  normal: {
    words: "step of the normal stress", many: "step of the normal force at", kind: "normal-stress-step", unit: () => "Pa",
    usual: ({ on, answer, sliding }) => sliding.reduce((sum, one, i) => sum + (one.name === on ? 0.05 * answer.sigmas[i] * one.area : 0), 0),
  },
  pull: {
    words: "pull on the block", many: "pull on", kind: "disturbance-step", unit: () => "Pa",
    usual: (known) => { // a share of the friction force on the body
      const { on, answer, sliding } = known, forces = force(known), speed = on ? answer.observed[`${on}.v`] : sliding[0].rate;
      return 0.01 * (speed > 0 ? forces.reduce((sum, one, i) => sum + one * sliding[i].rate, 0) / speed : Math.max(...forces));
    },
  },
  blow: { words: "blow on the block, its velocity", many: "blow that multiplies the velocity of", kind: "", unit: () => "1", usual: () => 10, ratio: true },
};

/** Text of a kind of disturbance. @param {string} kind @param {any} data */
export function called(kind, { phrases, area }) {
  const { words, many } = DISTURBANCES[kind];
  return phrases ? many ?? words : named(words, area === null ? "Pa" : "N");
}

/** Unit of the size of a disturbance; forces instead of stresses for machines and rigs with an area. @param {any} data @param {string} kind @param {string} on */
function unitOn(data, kind, on) {
  const speed = data.parameters.find((one) => one.name === data.speed).unit, own = DISTURBANCES[kind].unit(speed.replace(/\/s$/, ""));
  if (own !== "Pa") return own;
  if (!data.phrases) return data.area === null ? "Pa" : "N";
  return data.motion.bodies.some(([name, unit]) => name === on && unit === "rad") ? "N m" : "N";
}

/**
 * Size, begin and duration of a disturbance (SI units) from the typed texts, with usual values for empty fields.
 * @param {import("./page.js").Page} page @param {any} motion @param {{kind: string, on: string, size: string, length: string}} given
 */
export function asked(page, motion, { kind, on, size: text, length }) {
  const { answer, rig: { data } } = page, { usual, ratio, positive } = DISTURBANCES[kind], si = unitOn(data, kind, on), few = (value) => Number(value.toPrecision(3));
  const lead = answer.eigenvalues.find((s) => s.im > 0) ?? answer.eigenvalues[0], per = data.area !== null && si === "N" ? data.area : 1;
  const period = Math.abs(lead.im > 0 ? (2 * Math.PI) / lead.im : 5 / (lead.re || 1)), until = length ? read("length", length, "s") : few(PERIODS * period);
  if (until === Infinity) throw new Error("a small disturbance grows or dies out too slowly to show; say how long the run lasts");
  const own = few(usual({ period: Math.min(period, until), slip: motion.scales.x, on, answer, sliding: motion.sliding }) * per);
  const size = text ? read("size", text.replace(/^×\s*/, ""), si) : own;
  if (!(until > 0)) throw new Refused("length", "the length of a run is above 0 s");
  if (ratio && !(size > 0)) throw new Refused("size", "the velocity is multiplied by a number above 0");
  if (positive && !(size > 0)) throw new Refused("size", "a hold lasts for more than 0 s");
  const from = Number((until / BEFORE).toPrecision(4)), at = kind === "blow" ? 0 : from, much = ratio ? `×\u00a0${digits(size)}` : shown(size, si);
  return {
    disturbance: kind, on, size: size / per, at: from, from: at, until, file: asFile(page, { kind, on, size, si, at: from, until }),
    words: `${at ? `At ${shown(at, "s")} (dashed line)` : "At the start"}: ${called(kind, data)}${on ? ` ${on}` : ""}, ${much}.`,
    usual: [ratio ? `× ${own}` : shown(own, si, 3), shown(few(PERIODS * period), "s", 3)],
  };
}

/** Error for a refused entry, with the field it was typed in. */
export class Refused extends Error {
  /** @param {"size" | "length"} field @param {string} words */
  constructor(field, words) {
    super(words);
    this.field = field;
  }
}

function read(field, text, si) {
  try {
    return parse(text, si, si);
  } catch (error) {
    throw new Refused(field, error instanceof Error ? error.message : String(error));
  }
}

/** Text that repeats a run on the command line: the table [protocol] of a rig file, or the starting values of a blow. */
function asFile(page, { kind, on, size, si, at, until }) {
  const { answer, rig: { data, values } } = page, drive = data.parameters.findIndex((one) => one.name === data.speed), one = data.parameters[drive];
  const table = `[protocol]\nuntil = "${until} s"\n`, plain = (product) => Number(product.toPrecision(15)); // 15 digits: without the tail of rounding
  if (kind === "blow") return `${table}\n# steadyslip simulate ${data.title}.toml --initial ${on ? `${on}.` : ""}v=${plain(size * (on ? answer.observed[`${on}.v`] : values[drive]))}\n`;
  const much = kind === "velocity" ? ["to", `"${plain(size * values[drive])} ${one.unit}"`] : [kind === "hold" ? "duration" : "by", `"${size} ${si}"`];
  return `${table}\n[[protocol.pieces]]\nkind = "${DISTURBANCES[kind].kind}"\nat = "${at} s"\n${much.join(" = ")}\n${on ? `on = "${on}"\n` : ""}`;
}
