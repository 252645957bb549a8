// What a rig does after a disturbance: the generated kernel under the transpiled driver, in slices, so that it can be
// stopped. Settings are those of steadyslip/motion/jobs.py, scales those of steadyslip/model/scales.py.
import { zeros } from "../../kernels/printers/runtime.js";

const SLICE = 2000, MOST_STEPS = 100000, HEAR = 20; // ms between looks at what the page says

/** A channel's new value behind the moment of the disturbance, or how long it lasts; a blow changes the start. */
const SEGMENTS = {
  velocity: (at, size, until, drive) => [[at, until, 0, drive * size, 0, 0]],
  hold: (at, size, until, drive) => (at + size < until ? [[at, at + size, 0, 0, 0, 0], [at + size, until, 0, drive, 0, 0]] : [[at, until, 0, 0, 0, 0]]),
  push: (at, size, until, drive) => [[at, until, size, drive, 0, 0]],
  normal: (at, size, until, drive) => [[at, until, 0, drive, 0, size]],
  pull: (at, size, until, drive) => [[at, until, 0, drive, size, 0]],
  blow: () => [],
};

/** The sizes that matter in steady sliding: of slip, velocity variable and memory, and of the unknown. */
function scales(facts, found, drive) {
  const many = facts.memory.length, [direct, bySlip, byUnknown] = found, size = Math.abs(direct);
  const byMemory = found.slice(3, 3 + many), decay = found.slice(3 + many, 3 + 2 * many), memory = found.slice(3 + 2 * many);
  const distances = [...decay.map((rate) => drive / Math.abs(rate)), size / Math.abs(bySlip)].filter((d) => Number.isFinite(d) && d > 0);
  const x = distances.length ? Math.min(...distances) : Math.abs(drive), w = facts.linear ? drive : 1;
  const of = new Map([["x", x], ["w", w], ...facts.memory.map((name, i) => {
    const weight = size / Math.abs(byMemory[i]), own = Math.abs(memory[i]);
    const scale = Number.isFinite(weight) && weight > 0 ? weight : own > 0 ? own : 1;
    return [name, own > 0 ? Math.min(scale, Math.max(own, scale * 1e-3)) : scale];
  })]);
  const sizes = facts.names.map((name, i) => (facts.kinds[i] === "integral" ? (x * x) / drive : of.get(name)));
  const share = facts.eliminated === null ? 1 : Math.abs(byMemory[facts.eliminated] / direct);
  return { x, sizes, unknown: facts.inertial ? (drive * drive) / x : w, posed: byUnknown > 0, share };
}

export class Motion {
  /** @param {any} machine @param {any} facts @param {any} driver */
  constructor(machine, facts, driver) {
    this.machine = machine;
    this.facts = facts;
    this.driver = driver;
    this.R = new Float64Array(facts.parameters.length + 1);
    this.log = []; // rows to write on, kept from run to run
    this.recorded = [];
    this.points = [];
    this.grow();
    this.y = new Float64Array(Math.max(facts.constants, 3 + 3 * facts.memory.length, facts.kept + 1) + 1);
  }

  ask(name, many, number = 0) {
    this.machine[name](this.R, number, this.y);
    return Array.from(this.y.subarray(0, many));
  }

  /** Parameters and steady normal stress. @param {ArrayLike<number>} values @param {number} sigma */
  set(values, sigma) {
    this.R.set(values);
    this.R[this.R.length - 1] = sigma;
    this.drive = this.R[this.facts.parameters.indexOf("drive.velocity")];
    this.scales = scales(this.facts, this.ask("weights", 3 + 3 * this.facts.memory.length), this.drive);
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
    const { facts, scales: own } = this, sigma = this.R[this.R.length - 1], constants = zeros(1, facts.all);
    constants[0].set(this.ask("constants", facts.constants));
    const found = this.ask("start", facts.kept + 1, disturbance === "blow" ? size : 1), start = zeros(1, facts.kept), many = facts.settings.ATOL;
    start[0].set(found.slice(0, facts.kept));
    const settings = zeros(1, many + facts.names.length), given = {
      RTOL: facts.rtol, MOST_STEPS, V_HIGH: this.drive * facts.blowUp, V_LOW: this.drive * facts.arrest,
      SIGMA_LOW: facts.contactShare * sigma, WATCH: 1, RECORD: 1, GUESS: facts.inertial ? 0 : found[facts.kept],
      Z_SCALE: own.unknown, FIRST_STEP: own.x / this.drive, V_DRIVE: this.drive,
    };
    for (const [name, value] of Object.entries(given)) settings[0][facts.settings[name]] = value;
    own.sizes.forEach((scale, i) => (settings[0][many + i] = facts.rtol * scale));
    const rows = disturbance === "blow" ? [[0, until, 0, this.drive, 0, 0]] : [[0, at, 0, this.drive, 0, 0], ...SEGMENTS[disturbance](at, size, until, this.drive)];
    const segments = zeros(1, rows.length, 9);
    rows.forEach((row, i) => segments[0][i].set(row));
    return [constants, start, settings, segments];
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
    const tables = this.tables(disturbance, size, at, until), cursor = zeros(c.SIZE + 1), S = zeros(facts.rows), point = 1 + facts.names.length;
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
    const { logged, recorded, names } = this.facts;
    for (const row of zeros(Math.max(128, this.log.length), logged)) this.log.push(row);
    for (const row of zeros(Math.max(2048, this.recorded.length), recorded + 1 + names.length)) {
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
    /** @type {any} */ (points).shape = [many, 1 + facts.names.length];
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
        if (course) scope.postMessage({ id, course });
      } catch (error) {
        scope.postMessage({ id, fault: error instanceof Error ? error.message : String(error) });
      }
    }
  };
}
