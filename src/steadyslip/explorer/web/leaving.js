// Export from the page: links, rig files, tables, images.
import { button, copy, make } from "./dom.js";

const LOOK = ["fill", "stroke", "stroke-width", "font-size", "font-family", "opacity", "stroke-opacity", "stroke-dasharray", "display"];
const PIXELS = 2; // pixels of an image for one pixel of the page

/** Export buttons of a page. @param {import("./page.js").Page} page */
export function leaving(page) {
  const { title } = page.rig.data;
  const save = (name, type, content) => {
    const address = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
    make("a", { href: address, download: `${title}-${name}` }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  };
  const canvas = () => page.chart.canvas, tells = [
    button("chart SVG", "save the chart as a drawing", () => save("chart.svg", "image/svg+xml", drawing(canvas()))),
    button("chart PNG", "save the chart as a picture", () => picture(canvas()).then((blob) => save("chart.png", "image/png", blob), () => (page.banner.notice.textContent = "This browser cannot make a picture of the chart; save the drawing (SVG)."))),
    button("edges CSV", "save values and edges as a table", () => save("edges.csv", "text/csv", listed(page))),
  ];
  for (const one of tells) one.className = "tells";
  return [
    ...(page.told ? [] : [button("link", "copy a link to what is shown", () => link(page))]),
    button("rig file", "save as a rig file", () => save("rig.toml", "text/plain", page.rig.toml())), ...tells,
  ];
}

function link(page) {
  const text = location.href.split("#")[0] + page.hash(), { notice } = page.banner;
  copy(text).then(() => page.say("The link is copied."), () => (notice.textContent = text));
}

/** Text of an SVG with computed colours, independent of style sheets. @param {any} canvas */
function drawing(canvas) {
  const copy = canvas.cloneNode(true), live = canvas.querySelectorAll("*");
  copy.querySelectorAll("*").forEach((element, n) => {
    const style = getComputedStyle(live[n]);
    for (const name of LOOK) element.setAttribute(name, style.getPropertyValue(name));
  });
  const [, , width, height] = canvas.getAttribute("viewBox").split(" ");
  const paper = copy.insertBefore(canvas.ownerDocument.createElementNS("http://www.w3.org/2000/svg", "rect"), copy.firstChild);
  for (const [name, value] of Object.entries({ width, height, fill: getComputedStyle(canvas.parentElement).backgroundColor })) paper.setAttribute(name, value);
  for (const [name, value] of Object.entries({ width, height, xmlns: "http://www.w3.org/2000/svg" })) copy.setAttribute(name, value);
  return new XMLSerializer().serializeToString(copy);
}

/** PNG image of an SVG. @param {any} canvas @returns {Promise<Blob>} */
async function picture(canvas) {
  const image = new Image(), [, , width, height] = canvas.getAttribute("viewBox").split(" ").map(Number);
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(drawing(canvas))}`;
  await image.decode();
  const pixels = make("canvas", { width: PIXELS * width, height: PIXELS * height });
  pixels.getContext("2d").drawImage(image, 0, 0, pixels.width, pixels.height);
  return new Promise((done, failed) => pixels.toBlob((blob) => (blob ? done(blob) : failed()), "image/png"));
}

function listed(page) {
  const edges = new Map(page.edges().map((edge) => [edge.i, edge.at])), quoted = (text) => `"${String(text).replace(/"/g, '""')}"`;
  const rows = page.rig.data.parameters.map((one, i) => [quoted(one.name), page.rig.values[i] * one.factor, edges.has(i) ? edges.get(i) * one.factor : "", quoted(one.unit)].join(","));
  return ["parameter,value,nearest edge,unit", ...rows, ""].join("\n");
}
