// The part "Design": the form, the drawing that follows it, the findings with their remedies, the design's TOML.

import { ask, figures, h, number, openText, save, toast, told } from "./base.js";
import { DesignForm } from "./form.js";
import { Stage } from "./stage.js";
import { design } from "./state.js";

export class DesignPart {
  constructor(start) {
    this.form = new DesignForm(start.schema);
    this.stage = new Stage("The pattern");
    this.look = { back: false, labels: "", sizes: true };
    this.note = h("p", { class: "note" });
    this.findings = h("div", { class: "box", "aria-live": "polite" });
    this.figures = h("div", { class: "box" });
    const toggle = (text, name, value) => h("button", { "aria-pressed": "false", onclick: (event) => {
      this.look[name] = this.look[name] === value ? (name === "labels" ? "" : false) : value;
      this.#press(event.target.parentElement);
      this.refresh();
    }, "data-name": name, "data-value": String(value) }, text);
    this.bar = h("div", { class: "bar" }, toggle("Ids", "labels", "markers"), toggle("Cells", "labels", "cells"), toggle("Sizes", "sizes", true), toggle("From the back", "back", true),
      h("span", { class: "gap" }), this.stage.buttons());
    this.frame = h("section", { class: "stage", "aria-label": "Drawing" }, this.bar, this.stage.element, this.note);
    const camera = h("input", { id: "camera", value: design.camera.join("x"), onchange: () => {
      const found = /^\s*(\d+)\s*[x×]\s*(\d+)\s*$/i.exec(camera.value);
      if (found) design.setCamera([Number(found[1]), Number(found[2])]); else toast("camera: expected width x height in px, as in 640x480");
    } });
    this.element = h("div", { class: "work" }, h("aside", { class: "side", "aria-label": "Parameters" }, this.form.element), this.frame,
      h("aside", { class: "side right", "aria-label": "Findings and figures" },
        h("div", { class: "box" }, h("label", { for: "camera" }, "Camera that the pattern fills, px"), camera,
          h("div", { class: "row" }, h("button", { onclick: () => this.#editToml() }, "TOML"), h("button", { onclick: () => save(`${design.fields.name || "design"}.toml`, this.toml ?? "") }, "Save"),
            h("button", { onclick: () => told(async () => { await navigator.clipboard.writeText(location.href.replace(/\/\?token=[^#]*/, "/")); toast("The link holds the whole design."); }) }, "Copy link"))), this.findings, this.figures));
    this.#press(this.bar);
    design.listen(() => this.refresh());
  }

  #press(bar) {
    for (const button of bar.querySelectorAll("[data-name]")) button.setAttribute("aria-pressed", String(String(this.look[button.dataset.name]) === button.dataset.value));
  }

  // One request is under way; of the changes meanwhile only the last is asked for.
  async refresh() {
    if (this.element.isConnected === false && this.shown) return;
    if (this.busy) { this.isStale = true; return; }
    this.busy = true;
    do {
      this.isStale = false;
      try {
        const asked = { fields: design.fields, camera: design.camera, back: this.look.back, labels: this.look.labels };
        this.#show(await ask("/api/design", { body: asked }));
      } catch (error) { this.#refuse(error); }
    } while (this.isStale);
    this.busy = false;
  }

  #show(found) {
    this.shown = true;
    this.toml = found.toml;
    const { report } = found, [width, height] = report.size_mm, pitch = report.pitch_mm;
    const drawing = new DOMParser().parseFromString(found.svg, "image/svg+xml").documentElement;
    const layers = [...drawing.children].map((child) => document.importNode(child, true));
    const size = 0.24 * pitch, texts = found.labels.text ?? [];
    const labels = h("g", { class: "labels", "font-size": size, "stroke-width": size / 6 }, texts.map((text, at) => h("text", { x: found.labels.xy[at][0], y: found.labels.xy[at][1] }, text)));
    const whites = report.code ? h("g", { class: "whites", "stroke-width": pitch / 14 }, found.whites.map((ring) => h("polygon", { points: ring.join(" ") }))) : null;
    const margin = Math.max(width, height) * (this.look.sizes ? 0.11 : 0.05);
    this.stage.show([-margin, -margin, width + 2 * margin, height + 2 * margin], ...layers, labels, ...(whites ? [whites] : []), this.look.sizes ? sizes(width, height, margin) : "");
    this.frame.classList.remove("stale");
    this.note.textContent = `${report.present_markers} markers · ${number(width)} × ${number(height)} mm · seen from the ${this.look.back ? "back" : "front"}`;
    this.form.refresh({ pitch_mm: pitch, layers: report.layers, width_mm: width, height_mm: height });
    this.form.mark(found.findings);
    const good = h("div", { class: "finding good" }, h("b", { class: "good" }, "No findings"), "The design can be made and read.");
    this.findings.replaceChildren(h("h2", {}, "Findings"), ...(found.findings.length ? found.findings.map((one) => this.#finding(one)) : [good]));
    const cells = Object.entries(report.cells).filter(([, count]) => count).map(([color, count]) => `${count} ${color}`).join(", ");
    this.figures.replaceChildren(h("h2", {}, "Figures"), figures([
      ["Pattern", `${report.pattern}, ${report.layers} layers`], ["Pitch", `${number(pitch)} mm`], ["Overall size", `${number(width)} × ${number(height)} mm`],
      ["Markers", report.present_markers], ["Virtual markers", report.virtual_markers], ["Cells", cells], ["Shortest edge", `${number(report.shortest_edge_mm)} mm`],
      ["Smallest feature", `${number(report.smallest_feature_mm)} mm`], ["Sharpest corner", `${number(report.sharpest_corner_deg)}°`], ["Digest", report.digest.slice(0, 12)]]));
  }

  #finding(finding) {
    const label = finding.severity === "error" ? "Will not work" : "May not work";
    return h("div", { class: `finding ${finding.severity}` }, h("b", { class: finding.severity }, label), finding.text, h("div", { class: "row" },
      finding.fields.length > 0 && h("button", { class: "tiny", onclick: () => this.#remedy(finding) }, "Apply the remedy"),
      finding.fields.length > 0 && h("button", { class: "tiny", onclick: () => this.form.focus(finding.fields[0]) }, "Show the field")));
  }

  #remedy(finding) {
    return told(async () => {
      const change = await ask("/api/remedy", { body: { fields: design.fields, camera: design.camera, subject: finding.subject } });
      const [pair] = Object.entries(change);
      if (!pair) { toast("No change of a single field removes this finding; see its words."); return; }
      const before = design.get(pair[0]);
      design.set(...pair);
      toast(`${pair[0]}: ${before ?? "usual"} → ${pair[1]}`);
    });
  }

  #refuse(error) {
    this.frame.classList.add("stale");
    const finding = { severity: "error", text: error.message, fields: error.fields ?? [] };
    this.form.mark([finding]);
    this.findings.replaceChildren(h("h2", {}, "Findings"), h("div", { class: "finding error", role: "alert" }, h("b", { class: "error" }, "No design"), error.message,
      finding.fields.length > 0 && h("div", { class: "row" }, h("button", { class: "tiny", onclick: () => this.form.focus(finding.fields[0]) }, "Show the field"))));
  }

  #editToml() {
    openText("The design as TOML", "Paste or open a design file; cmpdesign build takes the same text.", ".toml", this.toml ?? "",
      async (text) => design.open((await ask("/api/toml", { body: text })).fields));
  }
}

function sizes(width, height, margin) {
  const at = margin * 0.45, size = margin * 0.3, thin = margin / 40;
  const line = (x1, y1, x2, y2) => h("line", { x1, y1, x2, y2 });
  return h("g", { class: "sizes", "stroke-width": thin, "font-size": size },
    line(0, height + at, width, height + at), line(0, height + at * 0.6, 0, height + at * 1.4), line(width, height + at * 0.6, width, height + at * 1.4),
    line(width + at, 0, width + at, height), line(width + at * 0.6, 0, width + at * 1.4, 0), line(width + at * 0.6, height, width + at * 1.4, height),
    h("text", { x: width / 2, y: height + at + size * 1.25 }, `${number(width)} mm`),
    h("text", { x: 0, y: 0, transform: `translate(${width + at + size * 1.25} ${height / 2}) rotate(-90)` }, `${number(height)} mm`));
}
