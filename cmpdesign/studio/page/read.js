// The part "Read": a picture that is dropped is read with the layout of the design; its markers are drawn over it.

import { ask, figures, h, number, told } from "./base.js";
import { Stage } from "./stage.js";
import { design } from "./state.js";

const STATUS = ["lost", "measured", "repaired", "fitted"], ID_EDGE_PX = 26;

export class ReadPart {
  constructor() {
    this.stage = new Stage("The picture with its markers");
    this.stage.onview = () => this.#refreshIds();
    this.stage.svg.addEventListener("click", (event) => this.#pick(this.stage.place(event)));
    this.look = { grid: true, ids: true, ellipses: false };
    const file = h("input", { type: "file", id: "picture", accept: "image/*,.tif,.tiff,.pgm,.ppm", multiple: true, hidden: true, onchange: () => this.#take([...file.files]) });
    const drop = h("div", { class: "drop" }, h("b", {}, "Drop a picture of the pad"), h("span", { class: "soft small" }, "PNG, JPEG, TIFF, WebP or BMP; a scan of a print sheet, too. It is read with the layout of the present design."),
      h("button", { class: "primary", onclick: () => file.click() }, "Choose pictures"), h("button", { onclick: () => this.#example() }, "Read the design’s own picture"), file);
    this.result = h("div", { class: "results" });
    this.pickedBox = h("div", { class: "box" }, h("h2", {}, "Marker"), h("p", { class: "soft" }, "Click a marker to see all about it."));
    const toggle = (text, name) => h("button", { "aria-pressed": String(this.look[name]), onclick: (event) => { this.look[name] = !this.look[name]; event.target.setAttribute("aria-pressed", String(this.look[name])); this.#draw(); } }, text);
    const frame = h("section", { class: "stage", "aria-label": "Picture" }, h("div", { class: "bar" }, toggle("Gridlines", "grid"), toggle("Ids", "ids"), toggle("Deviations", "ellipses"),
      h("span", { class: "legend" }, h("span", { class: "l1" }, "measured"), h("span", { class: "l2" }, "repaired"), h("span", { class: "l3" }, "fitted")), h("span", { class: "gap" }), this.stage.buttons()), this.stage.element);
    this.element = h("div", { class: "work two" }, h("aside", { class: "side", "aria-label": "Reading" }, h("div", { class: "box" }, drop), this.result, this.pickedBox), frame);
    this.element.addEventListener("dragover", (event) => { event.preventDefault(); drop.classList.add("over"); });
    this.element.addEventListener("dragleave", () => drop.classList.remove("over"));
    this.element.addEventListener("drop", (event) => { event.preventDefault(); drop.classList.remove("over"); this.#take([...event.dataTransfer.files]); });
  }

  async #take(files) { for (const file of files) await this.#read(file, file.name); }

  #example() {
    return told(async () => this.#read(await ask("/api/seen", { body: { fields: design.fields, camera: design.camera }, as: "blob" }), "the design’s own picture"));
  }

  async #read(blob, name) {
    this.result.replaceChildren(h("div", { class: "box" }, h("p", { class: "soft" }, `Reading ${name}.`)));
    try {
      const query = new URLSearchParams({ name, fields: JSON.stringify(design.fields) });
      this.found = await ask(`/api/readings?${query}`, { body: blob });
    } catch (error) {
      this.result.replaceChildren(h("div", { class: "box" }, h("div", { class: "finding error", role: "alert" }, h("b", { class: "error" }, "Not read"), error.message)));
      return;
    }
    this.picked = null;
    this.shownPicture = "picture";
    this.#show();
    this.#draw();
  }

  #show() {
    const found = this.found, quality = found.quality ?? {}, isPattern = found.status !== undefined;
    const verdict = h("div", { class: `finding ${found.verified ? "good" : "error"}` }, h("b", { class: found.verified ? "good" : "error" }, found.verified ? "Verified" : "Not verified"), found.reason ?? found.line ?? `${found.measured} of ${found.present} markers measured, seen from the ${found.mirrored ? "back" : "front"}.`);
    const hints = [...new Set([...(quality.hints ?? []), ...(found.advice ?? [])])].filter((hint) => !(found.reason ?? "").includes(hint)).map((hint) => h("div", { class: "finding warning" }, hint));
    const boxes = [h("div", { class: "box" }, h("h2", {}, found.name), verdict, hints, h("a", { class: "button", href: `/api/readings/${found.key}/report.zip`, download: "report.zip" }, "Report a problem, ZIP"))];
    if (isPattern) {
      const total = Object.values(found.timings_ms).reduce((sum, one) => sum + one, 0), most = Math.max(...Object.values(found.timings_ms));
      boxes.push(
        h("div", { class: "box" }, h("h2", {}, "Markers"), figures([["Measured", `${found.measured} of ${found.present}`], ["Repaired", found.repaired], ["Fitted", found.fitted], ["Lost", found.lost], ["Contradicting cells", found.contradictions.length]])),
        quality.edge_px ? h("div", { class: "box" }, h("h2", {}, "Picture"), figures([["Size", found.size_px.join(" × ") + " px"], ["Blur", `${number(quality.blur_px, 3)} px`], ["Noise", `${number(quality.noise, 3)} of 255`], ["Contrast", number(quality.contrast, 3)], ["Clipped", `${number(100 * quality.clipping, 2)} %`], ["Evenness", number(quality.evenness, 2)], ["Edge", `${number(quality.edge_px, 3)} px`]])) : "",
        h("div", { class: "box" }, h("h2", {}, `Stages, ${total.toFixed(1)} ms`), h("div", { class: "stages" }, ["picture", ...found.stages].map((stage) => h("button", { "aria-pressed": "false", onclick: () => { this.shownPicture = stage; this.#draw(); } }, h("img", { src: this.#address(stage), alt: "", loading: "lazy" }), stage))),
          h("div", { class: "times" }, Object.entries(found.timings_ms).map(([name, ms]) => { const bar = h("i"); bar.style.width = `${(100 * ms) / most}%`; return h("div", {}, name, bar, h("em", {}, `${ms.toFixed(1)} ms`)); }))));
    } else if (found.sheet) boxes.push(h("div", { class: "box" }, h("h2", {}, "Print sheet"), figures(Object.entries(found.sheet).map(([name, value]) => [name.replaceAll("_", " "), typeof value === "number" ? number(value, 5) : value]))));
    this.result.replaceChildren(...boxes);
  }

  #address(stage) { return `/api/readings/${this.found.key}/${stage}.jpg`; }

  #draw() {
    if (!this.found) return;
    const { size_px: [width, height], xy, status, edges, cov } = this.found, layers = [];
    // The centre of the top-left pixel is (0, 0).
    layers.push(h("image", { href: this.#address(this.shownPicture), x: -0.5, y: -0.5, width, height }));
    if (xy && this.shownPicture === "picture") {
      if (this.look.grid) layers.push(h("path", { class: "gridlines", d: edges.map(([from, to]) => `M${xy[from]}L${xy[to]}`).join("") }));
      layers.push(h("g", { class: "dots", "stroke-width": 5 }, [1, 2, 3].map((code) => h("path", { class: `s${code}`, d: xy.filter((_, at) => status[at] === code).map((point) => `M${point}h0`).join("") }))));
      if (this.look.ellipses) layers.push(h("g", { class: "ellipses" }, xy.map(([x, y], at) => ellipse(x, y, cov[at], 50))));
      this.ids = h("g", { class: "labels" });
      this.ring = h("circle", { class: "picked", r: 0 });
      layers.push(this.ids, this.ring);
    }
    this.stage.show([-0.5, -0.5, width, height], ...layers);
    for (const button of this.result.querySelectorAll(".stages button")) button.setAttribute("aria-pressed", String(button.textContent === this.shownPicture));
    this.#refreshIds();
    this.#ring();
  }

  // Ids are written where the gridlines are long enough on the screen.
  #refreshIds() {
    if (!this.ids?.isConnected) return;
    const { xy, ids, quality } = this.found, scale = this.stage.pxPerUnit, [left, top, width, height] = this.stage.view;
    const isLegible = this.look.ids && scale * (quality?.edge_px ?? 0) >= ID_EDGE_PX;
    const inside = ([x, y]) => x > left && x < left + width && y > top && y < top + height;
    this.ids.setAttribute("font-size", 12 / scale);
    this.ids.setAttribute("stroke-width", 2.4 / scale);
    this.ids.replaceChildren(...(isLegible ? xy.flatMap((point, at) => (inside(point) ? [h("text", { x: point[0], y: point[1] - 11 / scale }, ids[at])] : [])) : []));
    this.ring.setAttribute("r", this.picked === null ? 0 : 9 / scale);
  }

  #pick([x, y]) {
    if (!this.found?.xy) return;
    const distances = this.found.xy.map((point) => Math.hypot(point[0] - x, point[1] - y)), near = distances.indexOf(Math.min(...distances));
    if (!(distances[near] < 14 / this.stage.pxPerUnit)) return;
    this.picked = near;
    const { ids, xy, status, cov, layer, index } = this.found, [xx, xy_, yy] = cov[near];
    this.pickedBox.replaceChildren(h("h2", {}, `Marker ${ids[near]}`), figures([["Status", STATUS[status[near]]], ["Place", `${xy[near].map((value) => value.toFixed(2)).join(", ")} px`], ["Deviation x, y", `${number(Math.sqrt(xx), 3)}, ${number(Math.sqrt(yy), 3)} px`], ["Covariance xy", `${number(xy_, 3)} px²`], ["Layer, index", `${layer[near]}, ${index[near]}`]]));
    this.#ring();
    this.#refreshIds();
  }

  #ring() {
    if (this.picked === null || !this.ring?.isConnected) return;
    const [x, y] = this.found.xy[this.picked];
    this.ring.setAttribute("cx", x);
    this.ring.setAttribute("cy", y);
  }
}

// The ellipse of one standard deviation, enlarged.
function ellipse(x, y, [xx, xy, yy], factor) {
  const mean = (xx + yy) / 2, half = Math.hypot((xx - yy) / 2, xy), turn = (Math.atan2(2 * xy, xx - yy) / 2) * (180 / Math.PI);
  return h("ellipse", { rx: factor * Math.sqrt(mean + half), ry: factor * Math.sqrt(Math.max(mean - half, 0)), transform: `translate(${x} ${y}) rotate(${turn})` });
}
