// What a rig does after a disturbance: the generated kernel under the transpiled driver, in slices, so that it can be
// stopped. What it starts from, scales, settings and segments, is generated too (steadyslip/explorer/motion.py).
import { zeros } from "../../kernels/printers/runtime.js";

const SLICE = 2000, HEAR = 20; // ms between looks at what the page says

export class Motion {
  /** @type {{x: number, posed: boolean, share: number}} */ scales;
  /** @type {number[]} */ settings;
  /** @type {number} */ drive;

  /** @param {any} machine @param {any} facts @param {any} driver */
  constructor(machine, facts, driver) {
    this.machine = machine;
    this.facts = facts;
    this.driver = driver;
    this.R = new Float64Array(facts.parameters.length + 2); // behind the parameters σss and the blow
    this.log = []; // rows to write on, kept from run to run
    this.recorded = [];
    this.points = [];
    this.grow();
    this.y = new Float64Array(Math.max(facts.constants, 3 + facts.settings, facts.kept + 1, facts.segments * facts.segment) + 1);
  }

  ask(name, many) {
    this.machine[name](this.R, 0, this.y);
    return Array.from(this.y.subarray(0, many));
  }

  /** Parameters and steady normal stress. @param {ArrayLike<number>} values @param {number} sigma */
  set(values, sigma) {
    this.R.set(values);
    this.R[values.length] = sigma;
    this.R[values.length + 1] = 1;
    this.drive = this.R[this.facts.parameters.indexOf("drive.velocity")];
    const [x, posed, share, ...settings] = this.ask("scales", 3 + this.facts.settings);
    this.scales = { x, posed: posed > 0, share };
    this.settings = settings;
    return this;
  }

  /** Why the rig cannot be moved so at these values; empty if it can. @param {string} disturbance */
  refusal(disturbance) {
    if (disturbance === "push" && this.ask("dashpot", 1)[0] !== 0) return "a sudden push through a dashpot is an infinite force";
    if (disturbance === "blow" && !this.facts.inertial) return "a blow needs a mass: without it the block takes any velocity at once";
    if (!this.scales.posed) return "the motion is ill-posed here";
    if (this.scales.share < this.facts.least) return "the state that the kernel leaves out has no weight here";
    return "";
  }

  /** The arrays that the driver takes: constants, start, settings, segments. */
  tables(disturbance, size, at, until) {
    const { facts } = this, constants = zeros(1, facts.all), start = zeros(1, facts.kept), settings = zeros(1, facts.settings);
    constants[0].set(this.ask("constants", facts.constants));
    this.R[facts.parameters.length + 1] = disturbance === "blow" ? size : 1;
    const found = this.ask("start", facts.kept + 1);
    start[0].set(found.slice(0, facts.kept));
    settings[0].set(this.settings);
    if (!facts.inertial) settings[0][facts.guess] = found[facts.kept];
    const rows = this.rows(disturbance, size, at, until), segments = zeros(1, rows.length, facts.segment);
    rows.forEach((row, i) => segments[0][i].set(row));
    return [constants, start, settings, segments];
  }

  /** Segments of a disturbance: begin and end are first in each; what lies behind the run is cut off. */
  rows(disturbance, size, at, until) {
    const { facts: { segment }, y } = this, rows = [];
    y.fill(-1);
    this.machine.segments[disturbance](Float64Array.of(at, size, until, this.drive), 0, y);
    for (let k = 0; y[k] >= 0 && y[k] < until; k += segment) rows.push([y[k], Math.min(y[k + 1], until), ...y.subarray(k + 2, k + segment)]);
    return rows;
  }

  /**
   * Move the rig, slice by slice. Stopped, there is what there was; where it is not wanted any more, nothing.
   * @param {{disturbance: string, size: number, at: number, until: number}} asked
   * @param {() => string} stopped empty, "stopped" or "unwanted"; asked between slices
   * @param {() => Promise<void>} pause between slices
   * @param {(time: number) => void} [told] how far it has come
   */
  async run({ disturbance, size, at, until }, stopped, pause, told = () => {}) {
    const { facts, machine, driver } = this, { layout, routines } = machine, c = facts.cursor;
    const tables = this.tables(disturbance, size, at, until), cursor = zeros(c.SIZE + 1), S = zeros(facts.rows), point = 1 + facts.size;
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

  /** More room for what is written down. */
  grow() {
    const { logged, recorded, size } = this.facts;
    for (const row of zeros(Math.max(128, this.log.length), logged)) this.log.push(row);
    for (const row of zeros(Math.max(2048, this.recorded.length), recorded + 1 + size)) {
      this.recorded.push(row);
      this.points.push(row.subarray(recorded));
    }
  }

  /** Series over time, slip events and how it ended. */
  observed(tables, many, log, status, end) {
    const { facts, machine, recorded } = this, o = facts.out, own = zeros(many), values = zeros(8 + facts.kept, many);
    const points = this.points.slice(0, many), segment = zeros(many), times = zeros(many);
    for (let i = 0; i < many; i++) {
      times[i] = recorded[i][0];
      segment[i] = recorded[i][1];
    }
    /** @type {any} */ (points).shape = [many, 1 + facts.size];
    const [constants, , settings, segments] = tables;
    this.driver.observe(machine.layout, machine.routines, constants, settings, segments, points, own, segment, times, values);
    const events = [], { SLIP_BEGINS, SLIP_ENDS, PEAK } = facts.kind;
    let open = null;
    for (const [kind, time, v, , , stress] of Array.from(log).sort((a, b) => a[1] - b[1])) {
      if (kind === SLIP_BEGINS) open = { begin: time, peak: v, stress };
      else if (open && kind === PEAK) open.peak = Math.max(open.peak, v);
      else if (open && kind === SLIP_ENDS) {
        events.push({ begin: open.begin, end: time, peak: open.peak, drop: open.stress - stress });
        open = null;
      }
    }
    const x = values[o.W_SLOPE], load = values[o.ADVANCE]; // of what follows the outputs, slip is first
    return { times, v: values[o.V], sigma: values[o.SIGMA], tau: values[o.TAU], x, load, events, status, end };
  }
}

/**
 * Wait for what is to be moved, from the page that this worker belongs to.
 * @param {any} scope @param {(facts: any) => Motion} begin
 */
export function serve(scope, begin) {
  let motion = /** @type {any} */ (null), wanted = 0, halted = false, heard = 0;
  const pause = async () => {
    if (Date.now() < heard + HEAR) return;
    await new Promise((done) => setTimeout(done)); // then the page is heard
    heard = Date.now();
  };
  scope.onmessage = async ({ data: { facts, stop, id, values, sigma, asked } }) => {
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
        const course = await motion.set(values, sigma).run(asked, () => (wanted !== id ? "unwanted" : halted ? "stopped" : ""), pause, told);
        if (course) scope.postMessage({ id, course }, [course.times.buffer, course.v.buffer]); // of which the other series are parts
      } catch (error) {
        scope.postMessage({ id, fault: error instanceof Error ? error.message : String(error) });
      }
    }
  };
}
