// Presets: rigs to begin with, made from the values of the file and their nearest edges.
import { inMenu } from "./controls.js";
import { make } from "./dom.js";
import { STABLE, isQuiet } from "./linear.js";
import { told } from "./quantities.js";
import { inside } from "./rig.js";

const MAX_EDGES = 3; // edges that have a preset, so that the menu stays short

/** Menu of presets: the rig of the file, just beyond its nearest edges, and at other speeds. @param {import("./page.js").Page} page */
export function presets(page) {
  const { parameters, speed } = page.rig.data, home = parameters.map((one) => one.value), drive = parameters.findIndex((one) => one.name === speed);
  const found = /** @type {[string, number, number][]} */ ([]);
  for (const edge of page.edges().filter((one) => !one.far).slice(0, MAX_EDGES)) {
    const one = parameters[edge.i], value = isQuiet(edge.beyond) ? edge.landing : edge.behind;
    if (inside(one, value)) found.push([`${edge.beyond === STABLE ? "just stable" : "just beyond the edge"}: ${inMenu(one, parameters)} ${told(one, value)}`, edge.i, value]);
  }
  for (const [words, times] of /** @type {[string, number][]} */ ([["ten times as fast", 10], ["a tenth of the speed", 0.1]])) {
    if (drive >= 0 && inside(parameters[drive], times * home[drive])) found.push([words, drive, times * home[drive]]);
  }
  const select = make("select", { className: "tells", "aria-label": "presets", title: "rigs to begin with" }, make("option", { textContent: "presets …", value: "" }), make("option", { textContent: "the rig of the file", value: "-1" }),
    ...found.map(([words], n) => make("option", { textContent: words, value: String(n) })));
  select.addEventListener("change", () => {
    const [, i, value] = found[Number(select.value)] ?? ["", -1, 0];
    if (select.value) page.put(home.map((own, n) => (n === i ? value : own)));
    select.value = "";
  });
  return select;
}
