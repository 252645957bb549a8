// Choices of a page besides values (bar, chart axes, disturbance, body shown), and their text in links.

const MOST = 40; // most letters of a size in a link
const FIELDS = { do: "disturbance", on: "on", of: "size", for: "length", show: "view" }; // fields of the motion by their key in a link

/** Choices in a link by key; they begin with ~, unlike parameters. @param {string} hash @returns {Record<string, string>} */
export function chosenIn(hash) {
  const found = /** @type {Record<string, string>} */ ({});
  for (const part of hash.slice(0, 10000).replace(/^#/, "").split("&")) {
    const [, name, value] = /^~(\w+)=(.*)$/.exec(part) ?? [];
    try {
      if (name) found[name] = decodeURIComponent(value).slice(0, MOST);
    } catch { /* no text at all */ }
  }
  return found;
}

/** Link text of the choices that differ from the initial ones. @param {import("./page.js").Page} page @returns {string[]} */
export function chosen(page) {
  const now = all(page);
  return Object.keys(now).filter((name) => now[name] !== page.first[name]).map((name) => `~${name}=${encodeURIComponent(now[name])}`);
}

/** Present choices by key. @param {import("./page.js").Page} page @returns {Record<string, string>} */
export function all(page) {
  const { rig: { data: { parameters }, bar }, chart, course } = page, named = (i) => parameters[i]?.name ?? "";
  const found = { bar: named(bar), across: named(chart.axes[0]), up: named(chart.axes[1]), part: page.part };
  if (course.mover) for (const [name, field] of Object.entries(FIELDS)) found[name] = field === "view" ? course.viewed() : course[field].value;
  return found;
}

/** Apply the choices of a link; the others become the initial ones. @param {import("./page.js").Page} page @param {Record<string, string>} given */
export function choose(page, given) {
  const { rig, chart, course, first } = page, wanted = { ...first, ...given }, at = (name) => rig.data.parameters.findIndex((one) => one.name === name);
  const known = (name) => (at(wanted[name]) >= 0 ? at(wanted[name]) : at(first[name]));
  rig.bar = known("bar");
  chart.axes = [known("across"), known("up")];
  if (chart.axes[0] === chart.axes[1]) chart.axes = [at(first.across), at(first.up)];
  page.open(wanted.part);
  if (!course.mover) return;
  for (const [name, field] of Object.entries(FIELDS)) {
    if (field === "view") course.look(wanted.show);
    else pick(course[field], wanted[name], first[name]);
    if (field === "disturbance") course.choose();
  }
}

/** Set the value of a field if it is allowed; of a list, if it has it. */
function pick(field, value, other) {
  field.value = value;
  if (field.tagName === "SELECT" && field.selectedIndex < 0) field.value = other;
  if (field.tagName === "SELECT" && field.selectedIndex < 0) field.selectedIndex = 0;
}
