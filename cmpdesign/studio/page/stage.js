// A drawing that is panned and zoomed: an SVG whose view box moves; also by keys.

import { h } from "./base.js";

export class Stage {
  // box: [x, y, width, height] in the drawing's units, which "fit" shows.
  constructor(label) {
    this.svg = h("svg", { role: "img", tabindex: 0, "aria-label": `${label}; drag or arrow keys move it, wheel or + and - zoom, 0 fits` });
    this.element = h("div", { class: "canvas" }, this.svg);
    this.box = this.view = [0, 0, 1, 1];
    this.onview = this.onpick = () => {}; // onpick: a click that moved nothing, at a place of the drawing
    this.svg.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(Math.exp(event.deltaY * 0.0015), this.place(event)); }, { passive: false });
    this.svg.addEventListener("pointerdown", (event) => { this.from = this.place(event); this.down = [event.clientX, event.clientY]; this.svg.setPointerCapture(event.pointerId); });
    this.svg.addEventListener("pointermove", (event) => { if (this.from) { const to = this.place(event); this.move(this.from[0] - to[0], this.from[1] - to[1]); } });
    for (const end of ["pointerup", "pointercancel"]) this.svg.addEventListener(end, () => { this.from = null; });
    this.svg.addEventListener("click", (event) => { if (Math.hypot(event.clientX - this.down?.[0], event.clientY - this.down?.[1]) < 4) this.onpick(this.place(event)); });
    this.svg.addEventListener("dblclick", () => this.fit());
    this.svg.addEventListener("keydown", (event) => this.#key(event));
  }

  // A new drawing keeps the view unless its box is another one.
  show(box, ...layers) {
    const isOther = box.some((value, at) => Math.abs(value - this.box[at]) > 1e-9);
    this.box = box;
    this.svg.replaceChildren(...layers);
    if (isOther) this.fit(); else this.#apply();
  }

  fit() { this.view = [...this.box]; this.#apply(); }
  move(dx, dy) { this.view = [this.view[0] + dx, this.view[1] + dy, this.view[2], this.view[3]]; this.#apply(); }

  zoom(factor, [x, y] = [this.view[0] + this.view[2] / 2, this.view[1] + this.view[3] / 2]) {
    const limited = Math.min(Math.max(factor, this.box[2] / 400 / this.view[2]), (4 * this.box[2]) / this.view[2]);
    this.view = [x - (x - this.view[0]) * limited, y - (y - this.view[1]) * limited, this.view[2] * limited, this.view[3] * limited];
    this.#apply();
  }

  // The place of a pointer, in the drawing's units.
  place(event) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    return [point.x, point.y];
  }

  get pxPerUnit() { return this.svg.getScreenCTM()?.a ?? 1; }
  #apply() { this.svg.setAttribute("viewBox", this.view.join(" ")); this.onview(); }

  #key(event) {
    const step = this.view[2] / 12, moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    if (moves[event.key]) this.move(...moves[event.key]);
    else if ("+=".includes(event.key)) this.zoom(1 / 1.25);
    else if (event.key === "-") this.zoom(1.25);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
  }

  buttons() {
    const button = (text, label, act) => h("button", { class: "icon", "aria-label": label, title: label, onclick: act }, text);
    return [button("−", "Zoom out", () => this.zoom(1.25)), button("+", "Zoom in", () => this.zoom(0.8)), button("⤢", "Fit", () => this.fit())];
  }
}
