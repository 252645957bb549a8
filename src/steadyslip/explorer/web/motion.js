// Simulated motion after a disturbance: the generated kernel under the transpiled driver, in slices, so that it can be
// stopped. Starting values, scales, settings and segments are generated too (steadyslip/explorer/motion.py).
import { zeros } from "../../kernels/printers/runtime.js";

const SLICE = 2000, HEAR = 20; // SLICE: steps of a slice; HEAR: ms between checks for messages of the page

export class Motion {
  /** @type {{x: number, posed: boolean, share: number}} */ scales;
  /** @type {number[]} */ settings;
  /** @type {number} */ drive;
  /** @type {{name: string, rate: number, area: number}[]} */ sliding; // contacts with slip rate and area in steady sliding

  /** @param {any} machine @param {any} facts @param {any} driver */
  constructor(machine, facts, driver) {
    this.machine = machine;
    this.facts = facts;
    this.driver = driver;
    this.behind = facts.parameters.length + facts.contacts.length; // index of the first share of a disturbance in R
    this.R = new Float64Array(this.behind + facts.behind);
    this.log = []; // log buffers, reused from run to run
    this.recorded = [];
    this.points = [];
    this.grow();
    this.y = new Float64Array(Math.max(facts.constants, 3 + 2 * facts.contacts.length + facts.settings, facts.kept + facts.guesses.length, facts.segments * facts.segment) + 1);
  }

  ask(name, many) {
    this.machine[name](this.R, 0, this.y);
    return Array.from(this.y.subarray(0, many));
  }

  /** Set parameters and steady normal stresses. @param {ArrayLike<number>} values @param {ArrayLike<number>} sigmas */
  set(values, sigmas) {
    const { contacts, parameters, settings } = this.facts, many = contacts.length;
    this.R.set(values);
    this.R.set(sigmas, parameters.length);
    this.share("", "", 1);
    this.drive = this.R[parameters.indexOf("drive.velocity")];
    const [x, posed, share, ...rest] = this.ask("scales", 3 + 2 * many + settings);
    this.scales = { x, posed: posed > 0, share };
    this.sliding = contacts.map((name, i) => ({ name, rate: rest[2 * i], area: rest[2 * i + 1] }));
    this.settings = rest.slice(2 * many);
    return this;
  }

  /** Set where a disturbance acts, and the size of a blow. @param {string} disturbance @param {string} on @param {number} size */
  share(disturbance, on, size) {
    for (const [kind, places] of Object.entries(this.facts.shares)) {
      for (const [name, place] of Object.entries(places)) this.R[this.behind + place] = kind === "blow" ? 1 : 0;
      if (kind === disturbance && on in places) this.R[this.behind + places[on]] = kind === "blow" ? size : 1;
    }
  }

  /** True if a disturbance would be an infinite force at these values. @param {string} disturbance */
  infinite(disturbance) {
    return disturbance === "push" && this.ask("dashpot", 1)[0] !== 0;
  }

  /** Reason why the run is impossible at these values; empty if it is possible. @param {string} disturbance */
  refusal(disturbance) {
    if (this.infinite(disturbance) || (disturbance === "blow" && !Object.keys(this.facts.shares.blow).length)) return this.facts.refused[disturbance];
    if (!this.scales.posed) return "the equations of this page do not hold at these values, as where a mass is set to zero; steadyslip simulate writes them anew";
    if (this.scales.share < this.facts.least) return "the state that the kernel leaves out has no weight here";
    return "";
  }

  /** Arrays of a run for the driver: constants, start, settings, segments. */
  tables(disturbance, on, size, at, until) {
    const { facts } = this, constants = zeros(1, facts.all), start = zeros(1, facts.kept), settings = zeros(1, facts.settings);
    this.share(disturbance, on, size);
    constants[0].set(this.ask("constants", facts.constants));
    const found = this.ask("start", facts.kept + facts.guesses.length);
    start[0].set(found.slice(0, facts.kept));
    settings[0].set(this.settings);
    facts.guesses.forEach((column, k) => (settings[0][column] = found[facts.kept + k]));
    const rows = this.rows(disturbance, size, at, until), segments = zeros(1, rows.length, facts.segment);
    rows.forEach((row, i) => segments[0][i].set(row));
    return [constants, start, settings, segments];
  }

  /** Segments of a disturbance (begin and end are the first two numbers of each), cut at the end of the run. */
  rows(disturbance, size, at, until) {
    const { facts: { segment }, y } = this, rows = [];
    y.fill(-1);
    this.machine.segments[disturbance](Float64Array.of(at, size, until, this.drive), 0, y);
    for (let k = 0; y[k] >= 0 && y[k] < until; k += segment) rows.push([y[k], Math.min(y[k + 1], until), ...y.subarray(k + 2, k + segment)]);
    return rows;
  }

  /**
   * Simulate slice by slice. A run that is stopped returns what it has; one that is unwanted returns nothing.
   * @param {{disturbance: string, on?: string, size: number, at: number, until: number}} asked
   * @param {() => string} stopped empty, "stopped" or "unwanted"; asked between slices
   * @param {() => Promise<void>} pause between slices
   * @param {(time: number) => void} [told] called with the time reached
   */
  async run({ disturbance, on = "", size, at, until }, stopped, pause, told = () => {}) {
    const { facts, machine, driver } = this, { layout, routines } = machine, c = facts.cursor;
    const tables = this.tables(disturbance, on, size, at, until), cursor = zeros(c.SIZE + 1), S = zeros(facts.rows), { point } = facts;
    cursor[c.LAST_JOB] = cursor[c.BUSY] = 1;
    cursor[c.PAUSED] = -1;
    const out = [zeros(1), zeros(1, facts.final + point), zeros(1, facts.tally), zeros(1, 0, point)];
    const { log, recorded } = this, ids = zeros(1);
    const done = (status, end) => this.observed(tables, cursor[c.RECORDED], log.slice(0, cursor[c.LOGGED]), status, end);
    for (;;) {
      const reason = driver.advance(layout, routines, S, ids, cursor, ...tables, zeros(0), ...out, log, recorded, SLICE);
      if (reason === 0) return done(facts.statuses[out[0][0]], out[1][0][0]);
      if (reason === 1) this.grow();
      const reached = cursor[c.RECORDED] ? recorded[cursor[c.RECORDED] - 1][0] : 0;
      told(reached);
      await pause();
      const why = stopped();
      if (why === "unwanted") return null;
      if (why) return done("stopped", reached);
    }
  }

  /** Enlarge the log buffers. */
  grow() {
    const { logged, recorded, point } = this.facts;
    for (const row of zeros(Math.max(128, this.log.length), logged)) this.log.push(row);
    for (const row of zeros(Math.max(2048, this.recorded.length), recorded + point)) {
      this.recorded.push(row);
      this.points.push(row.subarray(recorded));
    }
  }

  /** Result of a run: time series, slip events and status. */
  observed(tables, many, log, status, end) {
    const { facts, machine, recorded } = this, o = facts.out, own = zeros(many), each = o.W_SLOPE, values = zeros(each * facts.contacts.length + facts.kept + facts.further, many);
    const points = this.points.slice(0, many), segment = zeros(many), times = zeros(many);
    for (let i = 0; i < many; i++) {
      times[i] = recorded[i][0];
      segment[i] = recorded[i][1];
    }
    /** @type {any} */ (points).shape = [many, facts.point];
    const [constants, , settings, segments] = tables;
    this.driver.observe(machine.layout, machine.routines, constants, settings, segments, points, own, segment, times, values);
    const events = this.slipEvents(log);
    const contacts = this.sliding.map(({ name, area }, c) => {
      const own = (place) => values[each * c + place];
      return { name, v: own(o.V), sigma: scaled(area, own(o.SIGMA)), tau: scaled(area, own(o.TAU)), way: own(o.ADVANCE) };
    });
    const bodies = facts.bodies.map(([name, unit, x, v]) => ({ name, unit, x: values[x], v: values[v] })), [{ v, sigma, tau, way }] = contacts;
    const x = values[each * contacts.length]; // displacement of a slider: first value after the outputs
    return { times, v, sigma, tau, x, load: way, contacts, bodies, ratio: this.sliding[0].rate / this.drive, events, status, end };
  }

  /** Slip events of a log, in order of their ends, as in Python. */
  slipEvents(log) {
    const { SLIP_BEGINS, SLIP_ENDS, PEAK, TROUGH, ARREST, BACKWARD_BEGINS, BACKWARD_ENDS } = this.facts.kind, events = /** @type {any[]} */ ([]);
    const open = /** @type {any[]} */ (this.sliding.map(() => null)), last = /** @type {any[]} */ (this.sliding.map(() => null)), arrest = this.sliding.map(() => -1), largest = this.sliding.map(() => 0);
    for (const [number, time, v, , , stress, slip, , count] of this.valid(log)) {
      const [c, kind] = this.kindOf(number), { name: contact, area } = this.sliding[c], one = open[c];
      if (kind === ARREST) arrest[c] = time;
      else if (kind === SLIP_BEGINS && !count) {
        if (last[c] && !one) last[c].rings.push(time);
      } else if (kind === SLIP_BEGINS || kind === BACKWARD_BEGINS) {
        const sign = kind === SLIP_BEGINS ? 1 : -1, before = /** @type {any} */ (events).findLast((other) => other.contact === contact && other.sign === sign && other.begin > 0);
        open[c] = { contact, sign, begin: time, peak: v, stress, slip, rings: [], every: before ? time - before.begin : null, sticks: before && arrest[c] > before.begin };
      } else if (one && (kind === PEAK || kind === TROUGH)) one.peak = one.sign * Math.max(one.sign * one.peak, one.sign * v);
      else if (one && (kind === SLIP_ENDS || kind === BACKWARD_ENDS)) {
        const drop = one.sign * area * (one.stress - stress), anew = drop < this.facts.share * largest[c]; // after a knock
        largest[c] = anew ? drop : Math.max(largest[c], drop);
        events.push((last[c] = { ...one, every: anew ? null : one.every, end: time, slip: slip - one.slip, drop }));
        open[c] = null;
      }
    }
    return events;
  }

  /** Contact and kind of a row of the log. */
  kindOf(number) {
    const { kinds } = this.facts;
    return [Math.floor((number - 1) / kinds), ((number - 1) % kinds) + 1];
  }

  /** Rows of a log in order of time, without begins and ends of slip events that later rows replace. */
  valid(log) {
    const { number, kind: { SLIP_BEGINS, BACKWARD_BEGINS } } = this.facts, over = new Set(), counted = /** @type {any[][][]} */ (this.sliding.map(() => []));
    for (const row of log) {
      if (!row[number]) continue;
      const [c, kind] = this.kindOf(row[0]), own = counted[c];
      if (kind === SLIP_BEGINS || kind === BACKWARD_BEGINS) {
        own.splice(row[number] - 1).flat().forEach((old) => over.add(old));
        own.push([row]);
      } else {
        const one = own[row[number] - 1];
        one.splice(1).forEach((old) => over.add(old));
        one.push(row);
      }
    }
    return Array.from(log).filter((row) => !over.has(row)).sort((a, b) => a[1] - b[1]);
  }
}

/** Multiply a series in place by a factor. @param {number} factor @param {any} series */
function scaled(factor, series) {
  if (factor !== 1) for (let i = 0; i < series.length; i++) series[i] *= factor;
  return series;
}

/**
 * Serve a page as its worker: run each simulation that it asks for.
 * @param {any} scope @param {(facts: any) => Motion} begin
 */
export function serve(scope, begin) {
  let motion = /** @type {any} */ (null), wanted = 0, halted = false, heard = 0;
  const pause = async () => {
    if (Date.now() < heard + HEAR) return;
    await new Promise((done) => setTimeout(done)); // let messages of the page arrive
    heard = Date.now();
  };
  scope.onmessage = async ({ data: { facts, stop, id, values, sigmas, asked } }) => {
    if (facts) motion = begin(facts);
    else if (stop) halted = true;
    else {
      [wanted, halted] = [id, false];
      let last = Date.now();
      const told = (time) => {
        if (Date.now() < last + 200) return;
        last = Date.now();
        scope.postMessage({ id, reached: time });
      };
      try {
        const course = await motion.set(values, sigmas).run(asked, () => (wanted !== id ? "unwanted" : halted ? "stopped" : ""), pause, told);
        if (course) scope.postMessage({ id, course }, [course.times.buffer, course.v.buffer]); // buffers that all series share
      } catch (error) {
        scope.postMessage({ id, fault: error instanceof Error ? error.message : String(error) });
      }
    }
  };
}
