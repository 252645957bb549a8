// Elements of HTML and SVG, made in one call.

const SVG = "http://www.w3.org/2000/svg";

/** An element with properties and children. @param {string} name @param {Record<string, any>} properties @returns {any} */
export function make(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in made && key !== "style") /** @type {any} */ (made)[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/** An element of SVG with attributes. @param {string} name @param {Record<string, any>} attributes @returns {any} */
export function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  made.append(...children);
  return made;
}

/** A button with a name for those who cannot see it. @param {string} text @param {string} label @param {() => void} action */
export function button(text, label, action) {
  return make("button", { type: "button", textContent: text, title: label, "aria-label": label, onclick: action });
}

/** Text for the clipboard. @param {string} text */
export const copy = async (text) => navigator.clipboard.writeText(text);

/** Write only what is not there yet: a browser does work for each write. @param {any} element @param {string} name @param {string} value */
export function put(element, name, value) {
  if (element.getAttribute(name) !== value) element.setAttribute(name, value);
}

/** The same for the text of an element. @param {any} element @param {string} text */
export function tell(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
