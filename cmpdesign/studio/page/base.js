// Elements, requests and messages, for all parts of the page.

const SVG = "http://www.w3.org/2000/svg";
const SVG_TAGS = new Set(["svg", "g", "path", "line", "text", "polygon", "circle", "ellipse", "polyline", "image"]);

// An element: attributes, "on..." listeners, properties ".value", and children; null and false are left out.
export function h(tag, attributes = {}, ...children) {
  const element = SVG_TAGS.has(tag) ? document.createElementNS(SVG, tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name.startsWith(".")) element[name.slice(1)] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat(9).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export class Refusal extends Error {
  constructor(text, fields = []) { super(text); this.fields = fields; }
}

// The answer to a request; what is refused is a Refusal with the server's own words.
export async function ask(path, { body, method, signal, as = "json" } = {}) {
  let answer;
  try {
    const isText = typeof body === "string" || body instanceof Blob || body === undefined;
    answer = await fetch(path, { method: method ?? (body === undefined ? "GET" : "POST"), body: isText ? body : JSON.stringify(body), signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refusal("the program does not answer; start it again with: cmpdesign studio");
  }
  if (answer.ok) return answer[as]();
  const told = await answer.json().catch(() => ({ error: `the program failed (HTTP ${answer.status}); its terminal says why` }));
  throw new Refusal(told.error, told.fields);
}

let hiding = 0;
export function toast(text) {
  const element = document.getElementById("toast");
  element.textContent = text;
  element.classList.add("on");
  clearTimeout(hiding);
  hiding = setTimeout(() => element.classList.remove("on"), 2500 + 40 * text.length);
}

// Run work whose failure is told in words.
export async function told(work) {
  try { return await work(); } catch (error) {
    if (error.name === "AbortError") return undefined;
    toast(error.message);
    if (!(error instanceof Refusal)) throw error;
  }
}

export function figures(pairs, kind = "") {
  return h("dl", { class: `figures ${kind}` }, pairs.map(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
}

export function save(name, data, type = "text/plain") {
  const link = h("a", { href: URL.createObjectURL(new Blob([data], { type })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// A message: the length of its document, the document, its columns of numbers, and the bytes that follow.
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true), told = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  for (const [name, count] of Object.entries(told.columns)) { told[name] = new Float32Array(buffer, at, count); at += 4 * count; }
  return { ...told, rest: new Uint8Array(buffer, at) };
}

// A dialog with a text that is pasted or opened; "take" may refuse it in words.
export function openText(title, about, accept, value, take) {
  const text = h("textarea", { rows: 18, "aria-label": title, spellcheck: "false", ".value": value });
  const problem = h("p", { class: "finding error", hidden: true, role: "alert" });
  const file = h("input", { type: "file", accept, "aria-label": "Open a file", onchange: async () => { text.value = await file.files[0].text(); } });
  const use = async () => {
    try { await take(text.value); dialog.close(); } catch (error) { problem.hidden = false; problem.textContent = error.message; }
  };
  const dialog = h("dialog", { "aria-label": title, onclose: () => dialog.remove() }, h("h2", {}, title), h("p", { class: "soft" }, about), file, text, problem,
    h("div", { class: "row" }, h("span", { class: "grow" }), h("button", { onclick: () => dialog.close() }, "Close"), h("button", { class: "primary", onclick: use }, "Take over")));
  document.body.append(dialog);
  dialog.showModal();
}

export const number = (value, digits = 4) => (value === null || value === undefined ? "–" : String(Number(Number(value).toPrecision(digits))));
export const bytes = (count) => (count < 1e6 ? `${Math.ceil(count / 1e3)} kB` : `${(count / 1e6).toFixed(1)} MB`);
export const words = (name) => name.replace(/_(mm_s|mm|deg|percent)$/, "").replaceAll("_", " ");
