// The sketch of the mechanism, which moves with time: the block, the load point, the ground under them.
const SHIFT = 16, MOVING = ".ground, .body, .link"; // how far the block goes in the drawing at most

export class Sketch {
  gain = 0; // how far parts move for a metre of slip
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
    const [x] = course.x, most = course.x.reduce((a, b) => Math.max(a, Math.abs(b - x)), 0);
    this.gain = most > 0 ? SHIFT / most : 0;
    this.first = x;
  }

  /** Where everything is: slip against the load point, and the way of that, m. @param {(series: any) => number} now @param {any} course */
  place(now, course) {
    const x = now(course.x), load = now(course.load), shift = this.gain * (x - this.first), passed = this.gain * load;
    for (const part of this.parts) {
      if (part.classList.contains("ground")) part.setAttribute("transform", `translate(${-(passed % this.period)} 0)`);
      else if (part.classList.contains("body")) part.setAttribute("transform", `translate(${shift} 0)`);
      else this.stretch(part, shift);
    }
  }

  stretch(part, shift) {
    const [x1, y1, x2, y2] = part.dataset.ends.split(" ").map(Number), dx = x2 - x1 - shift, dy = y2 - y1;
    const angle = (Math.atan2(dy, dx) * 180) / Math.PI;
    part.setAttribute("transform", `translate(${x1 + shift} ${y1}) rotate(${angle}) scale(${Math.hypot(dx, dy)} 1)`);
  }
}
