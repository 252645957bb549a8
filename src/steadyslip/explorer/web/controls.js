// Controls of parameters: a slider and a text field each; the slider track has the colour of the status at each value.
import { make, put, subscripted, tell } from "./dom.js";
import { CLASSES } from "./linear.js";
import { parse, told, unitFor, unitIn } from "./quantities.js";
import { inside } from "./rig.js";
import { named } from "./words.js";

const MEMBERS = { bodies: "body", links: "link", contacts: "contact" }; // of a machine, whose parts are groups
const EDGE = "1.5px", HATCH = 0.02; // EDGE: width of the mark of an edge; HATCH: period of the hatching, share of the track
const THIN = 0.006; // least share of a track for a visible colour
const ROOM = 15; // letters that fit into a field
const STEPS = 1000, NEAR = 0.005, FAR = 0.05;
const KEYS = { ArrowRight: NEAR, ArrowUp: NEAR, ArrowLeft: -NEAR, ArrowDown: -NEAR, PageUp: FAR, PageDown: -FAR };

export class Controls {
  /** @param {import("./page.js").Page} page */
  constructor(page) {
    this.page = page;
    this.box = make("section", { className: "controls", "aria-label": "parameters" }, make("p", { className: "invites", textContent: "Drag a slider and watch the verdict; or type a value with its unit, as 2.5\u00a0kN." }));
    let before = "";
    this.rows = page.rig.data.parameters.map((one, i) => {
      const [part, member] = one.name.split("."), group = part in MEMBERS ? `${MEMBERS[part]} ${member}` : part;
      if (group !== before) this.box.append(make("h2", { textContent: group }));
      before = group;
      const row = this.row(one, i);
      this.box.append(row.box);
      return row;
    });
    this.hidden = new Set(); // rows out of view
    const watch = new IntersectionObserver((all) => {
      for (const one of all) {
        if (one.isIntersecting) this.hidden.delete(one.target);
        else this.hidden.add(one.target);
      }
    });
    for (const { box } of this.rows) watch.observe(box);
  }

  /** True if the row of a parameter can be seen. @param {number} i */
  inView(i) {
    return !this.hidden.has(this.rows[i].box);
  }

  row(one, i) {
    const label = `${one.title}: ${named(one.doc, one.unit)}`, { page } = this, id = `taken-${Math.random().toString(36).slice(2)}`; // unique: a document may have several pages
    const slider = make("input", { type: "range", min: "0", max: String(STEPS), step: "any", "aria-label": label, "data-name": one.name });
    const text = make("input", { type: "text", "aria-label": `${label}, value with unit`, spellcheck: false, autocomplete: "off", "aria-describedby": id, "data-name": one.name });
    const fault = make("span", { className: "fault", role: "alert" }), taken = make("span", { className: "taken hint", id });
    const ends = ["", ""].map((text) => make("small", { textContent: text })); // edges beyond the ends of the track
    const row = { box: /** @type {any} */ (null), slider, text, fault, taken, ends, name: /** @type {any} */ (null), refused: NaN };
    slider.addEventListener("input", () => page.slide(i, Number(slider.value) / STEPS, true));
    slider.addEventListener("change", () => page.rest());
    slider.addEventListener("keydown", (event) => {
      const step = KEYS[event.key];
      if (step === undefined) return;
      event.preventDefault();
      event.stopPropagation(); // notebooks would use the keys themselves
      page.slide(i, Number(slider.value) / STEPS + step, false);
    });
    text.addEventListener("change", () => this.typed(i));
    text.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.forget(i);
      this.show();
    });
    text.addEventListener("focus", () => tell(taken, this.unit(i) === "1" ? "" : `a bare number counts in ${this.unit(i)}`));
    text.addEventListener("input", () => tell(taken, this.taken(i)));
    text.addEventListener("blur", () => tell(taken, ""));
    const about = named(one.doc, one.unit); // left out where it says no more than the title
    const name = make("span", { className: "name" }, make("b", {}, ...lettered(one)), " ", make("small", {}, ...(about.startsWith(one.title.split(" ")[0]) || one.title.endsWith(about) ? [] : numbered(about))));
    return Object.assign(row, { box: make("div", { className: "row" }, name, text, slider, make("span", { className: "ends tells" }, ...ends), taken, fault), name });
  }

  /** Unit assumed for a typed number without unit. @param {number} i */
  unit(i) {
    const { rig } = this.page;
    return unitFor(rig.data.parameters[i], rig.values[i])[1] || "1";
  }

  /** Hint text on the meaning of a number without unit. @param {number} i */
  taken(i) {
    const { value } = this.rows[i].text, unit = this.unit(i);
    return unit === "1" || unitIn(value) || !unitIn(`${value} s`) ? "" : `taken as ${value.trim()} ${unit}`;
  }

  /** @param {number} i */
  typed(i) {
    const { rig } = this.page, one = rig.data.parameters[i], row = this.rows[i];
    try {
      const value = parse(row.text.value, one.unit, this.unit(i), [one.own[0], one.own[1]]) / one.factor;
      if (!inside(one, value)) throw new Error(`allowed: ${one.allowed}`);
      this.forget(i);
      this.page.place(i, value);
    } catch (error) {
      row.refused = rig.values[i];
      row.text.setAttribute("aria-invalid", "true");
      tell(row.fault, `${error instanceof Error ? error.message : error}; Esc brings ${told(one, rig.values[i], 6)} back`);
    }
  }

  /** Replace a refused entry by the present value. @param {number} i */
  forget(i) {
    const { text, fault } = this.rows[i];
    this.rows[i].refused = NaN;
    text.removeAttribute("aria-invalid");
    tell(fault, "");
  }

  /** Update the shown values and tracks. */
  show() {
    const { rig, tracks } = this.page;
    this.rows.forEach(({ box, slider, text, name, ends, refused }, i) => {
      if (!this.page.due(i)) return;
      const one = rig.data.parameters[i], value = rig.values[i], [factor, unit] = unitFor(one, value);
      const place = String(STEPS * this.page.scale(i).of(value)), typed = (many) => `${Number((value / factor).toPrecision(many))} ${unit}`.trim(), words = typed(typed(6).length > ROOM ? 4 : 6);
      if (slider.value !== place) slider.value = place;
      put(slider, "aria-valuetext", told(one, value));
      if (!Object.is(refused, value)) {
        if (!Number.isNaN(refused)) this.forget(i);
        if (text.value !== words) text.value = words;
      }
      const [below, above] = this.page.beyond(i);
      tell(ends[0], below === undefined ? "" : `◂ edge ${told(one, below)}`);
      tell(ends[1], above === undefined ? "" : `edge ${told(one, above)} ▸`);
      box.classList.toggle("pinned", this.page.chart.axes.includes(i));
      name.classList.toggle("changed", !Object.is(value, one.value));
      const stops = visible(tracks[i], this.page.scale(i).of(value)).flatMap((part, n) => [...(n ? [`var(--ink) ${inPercent(part.from)}`, `var(--ink) calc(${inPercent(part.from)} + ${EDGE})`] : []), ...filled(part)]);
      put(slider, "style", `--track: linear-gradient(to right, ${stops.join(", ")})`);
    });
  }
}

const inPercent = (share) => `${(100 * share).toFixed(2)}%`;

/** Stops of the colour gradient of a part of a track; that without steady sliding is hatched. */
function filled({ from, to, status }) {
  const name = CLASSES[status], many = name === "none" ? Math.max(1, Math.round((to - from) / HATCH)) : 0, at = (k) => inPercent(from + ((to - from) * k) / many);
  const hatches = Array.from({ length: many }, (_, k) => `var(--none) ${at(k + 0.65)}, var(--soft) ${at(k + 0.65)} ${at(k + 1)}, var(--none) ${at(k + 1)}`);
  return [`var(--${name}) ${inPercent(from)}`, ...hatches, `var(--${name}) ${inPercent(to)}`];
}

/** Title of a parameter with its letter, the subscript below the line. @param {any} one */
export const lettered = ({ title }) => numbered(title.replace(/ (?=\S+$)/, "\u00a0")); // the letter stays with the last word

/** Text with subscripts, a number behind a letter, as in σ0, among them. @param {string} text */
const numbered = (text) => subscripted(text.replace(/(?<![\p{L}\d_])(\p{L})(?=\d)/gu, "$1_"));

/** Title of a parameter in a menu, which sets no subscripts: in words, if these name no other. @param {any} one @param {any[]} all */
export function inMenu({ title }, all) {
  const words = (/** @type {string} */ text) => text.replace(/ ?\S+_\S+$/, ""), own = words(title);
  return own && all.filter((other) => words(other.title) === own).length === 1 ? own : title;
}

/** Parts of a track, thin ones widened to be visible, but never over the position of the rig. @param {{from: number, to: number, status: number}[]} parts @param {number} own */
function visible(parts, own) {
  const found = parts.map(({ from, to, status }) => ({ from, to, status }));
  found.forEach((part, n) => {
    const before = found[n - 1], next = found[n + 1], middle = 0.5 * (part.from + part.to);
    if (part.to - part.from >= THIN || !before || !next || before.to - before.from < 2 * THIN || next.to - next.from < 2 * THIN) return;
    const from = own <= part.from && own > middle - THIN ? part.from : own >= part.to && own < middle + THIN ? part.to - THIN : middle - 0.5 * THIN;
    [part.from, part.to] = [from, from + THIN];
    [before.to, next.from] = [part.from, part.to];
  });
  return found;
}
