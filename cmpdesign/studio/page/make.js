// The part "Make": products of the design built as jobs, with their log, files and pictures.

import { ask, bytes, h, told } from "./base.js";
import { Laser } from "./laser.js";
import { design } from "./state.js";

const PRODUCTS = [
  ["svg", "SVG", "the pattern, true to size", true], ["layout", "Layout", "layout.json, which the reader needs", true], ["preview", "Preview", "a dimensioned drawing", true],
  ["report", "Report", "key figures", true], ["laser", "Laser job", "a pass a color as SVG, DXF, LightBurn, G-code; coupon; as made", false],
  ["mold", "Casting molds", "STEP files, process sheet, masses to weigh", false], ["mesh", "Meshes", "molds and pad as STL, GLB, 3MF; shown in 3-D", false],
  ["print", "Print sheet", "pads on a page, SVG and PDF", false]];
const POLL_MS = 400;

export class MakePart {
  constructor() {
    this.jobs = h("div", { class: "box" }, h("h2", {}, "Builds"), h("p", { class: "soft" }, "None yet."));
    this.stageBar = h("div", { class: "bar", role: "group", "aria-label": "Shown" });
    this.view = h("div", { class: "show" });
    this.boxes = PRODUCTS.map(([name, title, about, usual]) => h("label", { class: "product" }, h("input", { type: "checkbox", name, ".checked": usual }), h("b", {}, title), h("span", { class: "soft small" }, about)));
    this.problem = h("p", { class: "finding error", hidden: true, role: "alert" });
    this.element = h("div", { class: "work two" },
      h("aside", { class: "side", "aria-label": "Products" }, h("div", { class: "box" }, h("h2", {}, "Products"), this.boxes, this.problem, h("button", { class: "primary", onclick: () => this.#build() }, "Build")), this.jobs),
      h("section", { class: "stage", "aria-label": "Pictures of the products" }, this.stageBar, h("div", { class: "canvas" }, this.view)));
    this.pictures = new Map([["Camera view", (isWanted) => this.#seen(isWanted)], ["Laser paths", () => this.#laser()]]);
    this.current = "Camera view";
  }

  refresh() { this.#showBar(); return this.#showPicture(this.current); }

  #showBar() {
    this.stageBar.replaceChildren(...[...this.pictures.keys()].map((name) => h("button", { "aria-pressed": String(name === this.current), onclick: () => { this.#showPicture(name); this.#showBar(); } }, name)));
  }

  #showPicture(name) {
    this.current = this.pictures.has(name) ? name : this.pictures.keys().next().value;
    this.model?.dispose();
    this.model = null;
    const turn = this.turn = {};
    return told(async () => this.pictures.get(this.current)(() => turn === this.turn)); // not shown when another was chosen
  }

  async #seen(isWanted) {
    try {
      const picture = await ask("/api/seen", { body: { fields: design.fields, camera: design.camera }, as: "blob" });
      if (isWanted()) this.#image(URL.createObjectURL(picture), `The pad as a camera of ${design.camera.join(" x ")} px sees it`);
    } catch (error) { this.view.replaceChildren(h("p", { class: "finding error", role: "alert" }, error.message)); }
  }

  async #laser() {
    this.laser ??= new Laser();
    this.view.replaceChildren(this.laser.element);
    await this.laser.refresh();
  }

  #image(address, text) { this.view.replaceChildren(h("img", { src: address, alt: text })); }

  #build() {
    const products = this.boxes.map((box) => box.querySelector("input")).filter((box) => box.checked).map((box) => box.name);
    return told(async () => {
      this.problem.hidden = true;
      let build;
      try { build = await ask("/api/builds", { body: { fields: design.fields, camera: design.camera, products } }); } catch (error) {
        this.problem.hidden = false;
        this.problem.textContent = error.message;
        return;
      }
      design.remember();
      const card = h("div", { class: "job" });
      if (this.jobs.children[1]?.tagName === "P") this.jobs.children[1].remove();
      this.jobs.children[0].after(card);
      await this.#follow(build, card, products);
    });
  }

  async #follow(build, card, products) {
    const stateWords = { running: "Building", done: "Done", failed: "Failed", canceled: "Canceled" };
    const title = h("b", {}), bar = h("progress", { max: 1, "aria-label": "Progress" }), log = h("pre", { class: "log", tabindex: 0, "aria-label": "Log" }), end = h("div", { class: "row" });
    card.replaceChildren(h("div", { class: "row" }, title, h("span", { class: "soft small grow" }, products.join(", "))), bar, log, end);
    const cancel = h("button", { class: "tiny", onclick: () => told(async () => show(await ask(`/api/builds/${build.key}`, { method: "DELETE" }))) }, "Cancel");
    const show = (state) => {
      build = state;
      title.textContent = stateWords[state.state];
      bar.value = state.progress;
      bar.hidden = state.state !== "running";
      log.textContent = state.log.join("\n") || "starting";
      log.scrollTop = log.scrollHeight;
    };
    end.append(cancel);
    for (show(build); build.state === "running"; show(await ask(`/api/builds/${build.key}`))) await new Promise((done) => setTimeout(done, POLL_MS));
    cancel.remove();
    if (build.state === "failed") end.replaceChildren(h("p", { class: "finding error", role: "alert" }, build.error));
    if (build.state === "done") this.#finish(build, card, end);
  }

  #finish(build, card, end) {
    const place = (name) => `/api/builds/${build.key}/files/${name.split("/").map(encodeURIComponent).join("/")}`;
    end.replaceChildren(h("a", { class: "button primary", href: `/api/builds/${build.key}/all.zip`, download: "pad.zip" }, "Download all, ZIP"));
    const findings = (build.result.findings ?? []).map((one) => h("p", { class: `finding ${one.severity} small` }, `${one.subject}: ${one.remedy}`));
    const files = h("details", {}, h("summary", {}, `${build.files.length} files`), h("ul", { class: "files" }, build.files.map((file) => h("li", {}, h("a", { href: place(file.name), download: file.name.split("/").at(-1) }, file.name), h("span", { class: "soft" }, bytes(file.bytes))))));
    card.append(...findings, files);
    this.pictures = new Map([...this.pictures].slice(0, 2));
    const names = build.files.map((file) => file.name);
    const add = (title, name) => { if (names.includes(name)) this.pictures.set(title, () => this.#image(place(name), title)); };
    add("Preview", "preview.png");
    add("Laser, as made", "laser/as-made.svg");
    add("Print sheet", "print/sheet.svg");
    for (const [title, name] of [["Mold in 3-D", "mesh/mold.glb"], ["Pad in 3-D", "mesh/pad.glb"]]) {
      if (names.includes(name)) this.pictures.set(title, async (isWanted) => {
        const [{ Model }, data] = await Promise.all([import("./model.js"), ask(place(name), { as: "arrayBuffer" })]);
        if (!isWanted()) return;
        this.model = new Model(data, title);
        this.view.replaceChildren(...this.model.elements);
      });
    }
    this.#showBar();
    this.#showPicture([...this.pictures.keys()].at(-1));
    this.#showBar();
  }
}
