// Helpers that make and update HTML and SVG elements.

const SVG = "http://www.w3.org/2000/svg";

/** HTML element with properties and children. @param {string} name @param {Record<string, any>} properties @returns {any} */
export function make(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in made && key !== "style") /** @type {any} */ (made)[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/** SVG element with attributes. @param {string} name @param {Record<string, any>} attributes @returns {any} */
export function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  made.append(...children);
  return made;
}

/** Button; what it does is its name for screen readers where its text is a sign. @param {string} text @param {string} title @param {() => void} action */
export function button(text, title, action) {
  return make("button", { type: "button", textContent: text, title, onclick: action, ...(text.length > 1 ? {} : { "aria-label": title }) });
}

/** Copy a text to the clipboard. @param {string} text */
export const copy = async (text) => navigator.clipboard.writeText(text);

/** Set an attribute only if it changes: browsers do work for each write. @param {any} element @param {string} name @param {string} value */
export function put(element, name, value) {
  if (element.getAttribute(name) !== value) element.setAttribute(name, value);
}

/** Place an element of a drawing; one without a place, as where a value is not finite, is hidden. @param {any} element @param {Record<string, number>} places */
export function putAt(element, places) {
  const all = Object.entries(places), display = all.every(([, at]) => Number.isFinite(at)) ? "" : "none";
  if (element.style.display !== display) element.style.display = display;
  if (!display) for (const [name, at] of all) element.setAttribute(name, at.toFixed(1));
}

/** Sentence in which no line ends between a number and its unit. @param {string} text */
export const unbroken = (text) => text.replace(/(\d) (?=[^\s\d(])/g, "$1\u00a0");

/** Text in which no line ends behind the slash of a unit, as in N/m. @param {string} text @returns {(string | Node)[]} */
const whole = (text) => text.split(/(\d\u00a0[^\s/]+\/[^\s,;:]+)/).map((part, n) => (n % 2 ? make("span", { className: "whole", textContent: part }) : part));

/** Text with the subscripts of letters, as in v_ref, below the line. @param {string} text @returns {(string | Node)[]} */
export const subscripted = (text) => text.split(/(?<=(?<![\p{L}\d_.])\p{L})_([\p{L}\d]+)/u).map((part, n) => (n % 2 ? make("sub", { textContent: part }) : part));

/** Set the text of an element only if it changes, with subscripts. @param {any} element @param {string} text */
export function tell(element, text) {
  if (element.told === text && element.firstChild) return;
  element.told = text;
  if (/[_/]/.test(text)) element.replaceChildren(...subscripted(text).flatMap((part) => (typeof part === "string" ? whole(part) : part)));
  else element.textContent = text;
}
