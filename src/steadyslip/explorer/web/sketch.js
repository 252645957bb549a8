// Moving sketches: block, load point and ground of a slider, bodies and links of a machine.
import { extent } from "./plot.js";

const SHIFT = 16, MOVING = ".ground, .body, .link"; // SHIFT: largest displacement of the block in the sketch, SVG units

export class Sketch {
  gain = 0; // SVG units for a metre of slip
  first = 0;
  caption = "The mechanism, seen from the load point";

  /** @param {string} text drawn by steadyslip/explorer/sketch.py */
  constructor(text) {
    this.canvas = /** @type {any} */ (document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true));
    this.parts = [...this.canvas.querySelectorAll(MOVING)];
    this.period = Number(this.canvas.dataset.period);
  }

  /** @param {any} course */
  take(course) {
    this.gain = gainFor(SHIFT, lead(course.x));
    this.first = course.x[0];
  }

  /** Move all parts to a time: slip relative to the load point and displacement of that, m. @param {(series: any) => number} now @param {any} course */
  place(now, course) {
    const x = now(course.x), load = now(course.load), shift = this.gain * (x - this.first), passed = this.gain * load;
    if (!Number.isFinite(shift + passed)) return; // the sketch stays where it was
    for (const part of this.parts) {
      if (part.classList.contains("ground")) part.setAttribute("transform", `translate(${-(passed % this.period)} 0)`);
      else if (part.classList.contains("body")) part.setAttribute("transform", `translate(${shift} 0)`);
      else this.stretch(part, shift);
    }
  }

  stretch(part, shift) {
    const [x1, y1, x2, y2] = part.dataset.ends.split(" ").map(Number);
    between(part, x1 + shift, y1, x2, y2, 1);
  }
}

/** Largest finite distance from the first value of a series. @param {any} series */
function lead(series) {
  const [low, high] = extent(series);
  return series.length ? Math.max(high - series[0], series[0] - low) : 0;
}

/** Scale that shows the largest displacement at a given size; 0 if there is none. @param {number} size @param {number} most */
const gainFor = (size, most) => (most > 0 && Number.isFinite(size / most) ? size / most : 0);

/** Place a link, drawn with a given length, between two points. */
function between(part, x1, y1, x2, y2, unit) {
  const dx = x2 - x1, dy = y2 - y1, angle = (Math.atan2(dy, dx) * 180) / Math.PI;
  part.setAttribute("transform", `translate(${x1} ${y1}) rotate(${angle}) scale(${Math.hypot(dx, dy) / unit} 1)`);
}

const TURN = 40, LINK = 62; // TURN: largest rotation of a wheel, degrees; LINK: length with which a link is drawn, SVG units

/** Moving sketch of a machine: bodies shift or turn in proportion to their lead over steady sliding. */
export class MachineSketch {
  caption = "The machine, as an observer moving with it sees it";
  /** @type {number[]} */ gain = [];

  /** @param {string} text drawn by steadyslip/explorer/machine_sketch.py @param {[string, string, number, number][]} bodies */
  constructor(text, bodies) {
    this.canvas = /** @type {any} */ (document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true));
    this.bodies = bodies.map(([name, unit]) => ({ name, turns: unit === "rad" }));
    this.parts = [...this.canvas.querySelectorAll(".part")];
    this.links = [...this.canvas.querySelectorAll(".link")];
  }

  /** @param {any} course */
  take(course) {
    const most = [0, 0]; // largest lead of sliding and of turning bodies
    course.bodies.forEach(({ x }, n) => (most[Number(this.bodies[n].turns)] = Math.max(lead(x), most[Number(this.bodies[n].turns)])));
    const gain = [gainFor(SHIFT, most[0]), gainFor(TURN, most[1])];
    this.gain = this.bodies.map(({ turns }) => gain[Number(turns)]);
  }

  /** @param {(series: any) => number} now @param {any} course */
  place(now, course) {
    const moved = /** @type {Record<string, number>} */ ({});
    this.bodies.forEach(({ name }, n) => (moved[name] = this.gain[n] * (now(course.bodies[n].x) - course.bodies[n].x[0])));
    if (!Object.values(moved).every(Number.isFinite)) return;
    for (const part of this.parts) {
      const { body, turns } = part.dataset;
      part.setAttribute("transform", turns ? `rotate(${moved[body]} ${turns})` : `translate(${moved[body] ?? 0} ${-(moved[`${body}.normal`] ?? 0)})`);
    }
    const wheels = new Set(this.parts.filter((part) => part.dataset.turns).map((part) => part.dataset.body)), shift = (name) => (wheels.has(name) ? 0 : moved[name] ?? 0);
    for (const link of this.links) {
      const [x1, y1, x2, y2] = link.dataset.ends.split(" ").map(Number), [one, other] = link.dataset.bodies.split(" ");
      between(link, x1 + shift(one), y1 - shift(`${one}.normal`), x2 + shift(other), y2 - shift(`${other}.normal`), LINK);
    }
  }
}
