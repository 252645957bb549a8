// A slider and a typed value for each parameter; every slider's track is painted with what would be.
import { CLASSES } from "./chart.js";
import { make, put, tell } from "./dom.js";
import { display, parse, shown } from "./quantities.js";
import { inside } from "./rig.js";

const ROOM = 15; // letters that a field has room for
const STEPS = 1000, NEAR = 0.005, FAR = 0.05;
const KEYS = { ArrowRight: NEAR, ArrowUp: NEAR, ArrowLeft: -NEAR, ArrowDown: -NEAR, PageUp: FAR, PageDown: -FAR };

export class Controls {
  /** @param {import("./page.js").Page} page */
  constructor(page) {
    this.page = page;
    this.box = make("section", { className: "controls", "aria-label": "parameters" });
    let group = "";
    this.rows = page.rig.data.parameters.map((one, i) => {
      if (one.group !== group) this.box.append(make("h2", { textContent: one.group }));
      group = one.group;
      const row = this.row(one, i);
      this.box.append(row.box);
      return row;
    });
  }

  row(one, i) {
    const label = `${one.name}: ${one.doc}`, { page } = this;
    const slider = make("input", { type: "range", min: "0", max: String(STEPS), step: "any", "aria-label": label });
    const text = make("input", { type: "text", "aria-label": `${label}, value with unit`, spellcheck: false, autocomplete: "off" });
    const fault = make("span", { className: "fault", role: "alert" });
    slider.addEventListener("input", () => page.slide(i, Number(slider.value) / STEPS, true));
    slider.addEventListener("change", () => page.rest());
    slider.addEventListener("keydown", (event) => {
      const step = KEYS[event.key];
      if (step === undefined) return;
      event.preventDefault();
      event.stopPropagation(); // notebooks take keys away from sliders
      page.slide(i, Number(slider.value) / STEPS + step, false);
    });
    text.addEventListener("change", () => this.typed(i, text.value, fault));
    const name = make("span", { className: "name" }, make("b", { textContent: one.label.replace(/[_.]/g, "$&\u200b") }), " ", make("small", { textContent: one.doc }));
    return { box: make("div", { className: "row" }, name, text, slider, fault), slider, text, fault, name };
  }

  typed(i, text, fault) {
    const { rig } = this.page, one = rig.data.parameters[i];
    try {
      const [, unit] = display(rig.values[i] * one.factor, one.unit);
      const value = parse(text, one.unit, unit || "1") / one.factor;
      if (!inside(one, value)) throw new Error(`allowed: ${one.allowed}`);
      fault.textContent = "";
      this.page.place(i, value);
    } catch (error) {
      fault.textContent = error instanceof Error ? error.message : String(error);
    }
  }

  /** Values and tracks as they are now. */
  show() {
    const { rig, tracks } = this.page;
    this.rows.forEach(({ slider, text, fault, name }, i) => {
      const one = rig.data.parameters[i], value = rig.values[i], [factor, unit] = display(value * one.factor, one.unit);
      const place = String(STEPS * this.page.scale(i).of(value)), told = (many) => `${Number(((value * one.factor) / factor).toPrecision(many))} ${unit.replace("^2", "²")}`.trim(), words = told(told(6).length > ROOM ? 4 : 6);
      if (slider.value !== place) slider.value = place;
      put(slider, "aria-valuetext", shown(value * one.factor, one.unit));
      if (document.activeElement !== text || !fault.textContent) {
        if (text.value !== words) text.value = words;
        tell(fault, "");
      }
      name.classList.toggle("changed", !Object.is(value, one.value));
      const stops = tracks[i].flatMap((part) => [part.from, part.to].map((at) => `var(--${CLASSES[part.status]}) ${(100 * at).toFixed(2)}%`));
      put(slider, "style", `--track: linear-gradient(to right, ${stops.join(", ")})`);
    });
  }
}
