// The part "Read": pictures are read with the layout of the design, or with one that was opened; their markers, and
// displacements between two of them, are drawn over them.

import { ask, h, number, openText, save, toast, told } from "./base.js";
import { markerBox, resultBoxes } from "./reading.js";
import { Stage } from "./stage.js";
import { design } from "./state.js";

const ID_EDGE_PX = 26;
const KINDS = [["npz", "NumPy, .npz"], ["csv", "table, .csv"], ["parquet", "Parquet"], ["mcap", "ROS 2, .mcap"]];

export class ReadPart {
  constructor() {
    this.stage = new Stage("The picture with its markers");
    this.stage.onview = () => this.#refreshIds();
    this.stage.onpick = (place) => this.#pick(place);
    this.look = { grid: true, ids: true, ellipses: false, arrows: "none" };
    this.readings = [];
    this.layout = { key: "", about: "" };
    const file = h("input", { type: "file", id: "picture", accept: "image/*,.tif,.tiff,.pgm,.ppm", multiple: true, hidden: true, onchange: () => { this.#take([...file.files]); file.value = ""; } });
    const drop = h("div", { class: "drop" }, h("b", {}, "Drop pictures of the pad"), h("span", { class: "soft small" }, "PNG, JPEG, TIFF, WebP or BMP. A scan of a print sheet and a photo of the laser’s coupon or grid are read, too."),
      h("button", { class: "primary", onclick: () => file.click() }, "Choose pictures"), h("button", { onclick: () => this.#example() }, "Read the design’s own picture"), file);
    this.layoutWords = h("span", { class: "soft small grow" });
    this.layoutReset = h("button", { class: "tiny", onclick: () => this.#setLayout({ key: "", about: "" }) }, "Use the design");
    this.list = h("div", { class: "box", hidden: true });
    this.result = h("div", { class: "results" });
    this.pickedBox = h("div", { class: "box" });
    const toggle = (text, name) => h("button", { "aria-pressed": String(this.look[name]), onclick: (event) => { this.look[name] = !this.look[name]; event.target.setAttribute("aria-pressed", String(this.look[name])); this.#draw(); } }, text);
    this.arrows = h("select", { "aria-label": "Displacement arrows", onchange: () => { this.look.arrows = this.arrows.value; this.#compare(); } },
      h("option", { value: "none" }, "No arrows"), h("option", { value: "rest" }, "From the picture at rest"), h("option", { value: "flat" }, "From the flat pattern"));
    this.scale = h("input", { type: "range", min: 0, max: 2.5, step: 0.05, value: 1, "aria-label": "Arrows, enlarged", oninput: () => { this.isScaled = true; this.#draw(); } });
    this.note = h("p", { class: "note", hidden: true });
    const frame = h("section", { class: "stage", "aria-label": "Picture" }, h("div", { class: "bar" }, toggle("Gridlines", "grid"), toggle("Ids", "ids"), toggle("Deviations", "ellipses"), this.arrows,
      h("label", { class: "row" }, "× ", this.scale), h("span", { class: "gap" }), this.stage.buttons()), this.stage.element, this.note);
    this.element = h("div", { class: "work two" }, h("aside", { class: "side", "aria-label": "Reading" },
      h("div", { class: "box" }, drop, h("div", { class: "row" }, this.layoutWords, h("button", { class: "tiny", onclick: () => this.#openLayout() }, "Other layout"), this.layoutReset)), this.list, this.result, this.pickedBox), frame);
    this.element.addEventListener("dragover", (event) => { event.preventDefault(); drop.classList.add("over"); });
    this.element.addEventListener("dragleave", () => drop.classList.remove("over"));
    this.element.addEventListener("drop", (event) => { event.preventDefault(); drop.classList.remove("over"); this.#take([...event.dataTransfer.files]); });
    this.#setLayout(this.layout);
  }

  #setLayout(layout) {
    this.layout = layout;
    this.layoutWords.textContent = layout.key ? `Read with: ${layout.about}` : "Read with the layout of the design.";
    this.layoutReset.hidden = !layout.key;
  }

  #openLayout() {
    openText("Another layout", "Paste or open a layout.json, or the coupon.json or grid.json of a laser job. Pictures are then read with it.", ".json", "",
      async (text) => { this.#setLayout(await ask("/api/layouts", { body: text })); toast(this.layoutWords.textContent); });
  }

  async #take(files) {
    for (const file of files) {
      if (file.name.endsWith(".json")) await told(async () => this.#setLayout(await ask("/api/layouts", { body: await file.text() })));
      else await this.#read(file, file.name);
    }
  }

  #example() {
    return told(async () => this.#read(await ask("/api/seen", { body: { fields: design.fields, camera: design.camera }, as: "blob" }), "the design’s own picture"));
  }

  async #read(blob, name) {
    this.#list(name);
    this.result.classList.add("stale");
    try {
      const query = new URLSearchParams({ name, fields: JSON.stringify(design.fields), layout: this.layout.key });
      const found = await ask(`/api/readings?${query}`, { body: blob });
      this.readings.push(found);
      await this.#choose(found);
    } catch (error) {
      this.#list();
      this.result.replaceChildren(h("div", { class: "box" }, h("div", { class: "finding error", role: "alert" }, h("b", { class: "error" }, "Not read"), error.message)));
    }
    this.result.classList.remove("stale");
  }

  async #choose(found) {
    this.found = found;
    this.picked = null;
    this.pickedBox.replaceChildren(h("h2", {}, "Marker"), h("p", { class: "soft" }, "Click a marker to see all about it."));
    // An unread picture is shown at the last stage that was reached.
    this.shownPicture = found.xy && !found.xy.length && found.stages.length ? found.stages.at(-1) : "picture";
    this.#show();
    await this.#compare();
    if (this.shownPicture !== "picture") this.stage.fit();
  }

  #show() {
    const actions = { stage: (name) => { this.shownPicture = name; this.#draw(); }, address: (stage) => this.#address(this.found, stage) };
    this.result.replaceChildren(...resultBoxes(this.found, actions));
    this.#list();
  }

  // The pictures; awaited: the name of one that is being read.
  #list(awaited) {
    const count = this.readings.length + (awaited ? 1 : 0), isRest = this.found && this.found === this.rest;
    this.list.hidden = !count;
    this.list.replaceChildren(h("h2", {}, count === 1 ? "Picture" : `${count} pictures`),
      h("div", { class: "pictures", role: "group", "aria-label": "Pictures" }, this.readings.map((one) => h("button", { "aria-pressed": String(one === this.found), title: one.name, onclick: () => told(async () => this.#choose(one)) },
        h("img", { src: this.#address(one, "picture"), alt: "", loading: "lazy" }), h("span", {}, `${one === this.rest ? "Rest: " : ""}${one.name}`))),
        awaited && h("button", { disabled: true, title: awaited }, h("i", { class: "blank" }), h("span", {}, `Reading ${awaited}`))),
      h("div", { class: "row" }, h("button", { "aria-pressed": String(Boolean(isRest)), disabled: !this.found?.xy?.length, onclick: () => this.#setRest(isRest ? null : this.found) }, "This is rest"),
        h("button", { onclick: () => { this.readings = []; this.rest = this.found = null; this.list.hidden = true; this.result.replaceChildren(); this.stage.show([0, 0, 1, 1]); this.note.hidden = true; } }, "Remove all")),
      h("div", { class: "row" }, h("label", { class: "row grow" }, "Record", this.kind ??= h("select", {}, KINDS.map(([value, text]) => h("option", { value }, text)))), h("button", { onclick: () => this.#record() }, "Save as track does")));
  }

  #setRest(reading) {
    this.rest = reading;
    if (reading) this.look.arrows = "rest"; else if (this.look.arrows === "rest") this.look.arrows = "none";
    this.#show();
    return this.#compare();
  }

  // The displacements that the arrows show.
  async #compare() {
    const found = this.found, from = this.look.arrows;
    this.arrows.value = from;
    this.moved = null;
    let problem = "";
    if (found?.xy?.length && from !== "none") {
      if (from === "rest" && !this.rest) problem = "No picture is at rest yet: choose one and press “This is rest”.";
      else {
        try {
          const moved = await ask(`/api/readings/${found.key}/moved${from === "rest" ? `?rest=${this.rest.key}` : ""}`);
          if (found !== this.found || from !== this.look.arrows) return;
          this.moved = moved;
          // The longest arrow has the length of some gridlines, until the user chooses.
          const longest = Math.max(...moved.px.map((by) => (by ? Math.hypot(...by) : 0)));
          if (!this.isScaled) this.scale.value = Math.log10(Math.max((2.5 * (found.quality?.edge_px ?? 20)) / longest, 1));
        } catch (error) { problem = error.message; }
      }
    }
    this.problem = problem;
    this.#draw();
    if (this.picked !== null) this.#tellPicked();
  }

  #record() {
    return told(async () => {
      const keys = this.readings.filter((one) => one.xy).map((one) => one.key), kind = this.kind.value;
      save(`run.${kind}`, await ask("/api/tracks", { body: { keys, rest: this.rest?.key, kind }, as: "blob" }));
      toast(`${keys.length} pictures are in run.${kind}, as cmpdesign track writes it.`);
    });
  }

  #address(reading, stage) { return `/api/readings/${reading.key}/${stage}.jpg`; }

  #draw() {
    if (!this.found) return;
    const { size_px: [width, height], xy, status, edges, cov, quality, explained } = this.found, layers = [], notes = [];
    // The centre of the top-left pixel is (0, 0).
    layers.push(h("image", { href: this.#address(this.found, this.shownPicture), x: -0.5, y: -0.5, width, height }));
    const enlarged = 10 ** Number(this.scale.value);
    if (xy && this.shownPicture === "picture") {
      if (this.look.grid) layers.push(h("path", { class: "gridlines", d: edges.map(([from, to]) => `M${xy[from]}L${xy[to]}`).join("") }));
      layers.push(h("g", { class: "dots", "stroke-width": 5 }, [1, 2, 3].map((code) => h("path", { class: `s${code}`, d: xy.filter((_, at) => status[at] === code).map((point) => `M${point}h0`).join("") }))));
      if (explained) layers.push(h("path", { class: "covered", d: xy.filter((_, at) => !explained[at]).map((point) => `M${point}h0`).join("") }));
      if (this.look.ellipses) {
        const sigmas = cov.map(([xx, , yy]) => Math.sqrt(xx + yy)).sort((one, other) => one - other);
        const factor = roundFactor((0.35 * (quality?.edge_px ?? 20)) / (sigmas[sigmas.length >> 1] || 1));
        layers.push(h("g", { class: "ellipses" }, xy.map(([x, y], at) => ellipse(x, y, cov[at], factor))));
        notes.push(`Ellipses: one standard deviation, × ${factor}.`);
      }
      if (this.moved) {
        const head = 0.18 * (quality?.edge_px ?? 20);
        layers.push(h("path", { class: "arrows", d: this.moved.px.map((by, at) => (by ? arrow(xy[at], by.map((value) => value * enlarged), head) : "")).join("") }));
        notes.push(`Displacement from ${this.moved.from ?? "the flat pattern that fits best"}: largest ${number(this.moved.largest_mm, 3)} mm, rms ${number(this.moved.rms_mm, 3)} mm; arrows × ${number(enlarged, 2)}.`);
      }
      this.ids = h("g", { class: "labels" });
      this.ring = h("circle", { class: "picked", r: 0 });
      layers.push(this.ids, this.ring);
    }
    this.note.textContent = this.problem || notes.join(" ");
    this.note.hidden = !this.note.textContent;
    this.stage.show([-0.5, -0.5, width, height], ...layers);
    for (const button of this.result.querySelectorAll(".stages button")) button.setAttribute("aria-pressed", String(button.dataset.stage === this.shownPicture));
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
    this.#tellPicked();
    this.#ring();
    this.#refreshIds();
  }

  #tellPicked() { this.pickedBox.replaceChildren(...markerBox(this.found, this.picked, this.moved)); }

  #ring() {
    if (this.picked === null || !this.ring?.isConnected) return;
    const [x, y] = this.found.xy[this.picked];
    this.ring.setAttribute("cx", x);
    this.ring.setAttribute("cy", y);
  }
}

// 1, 2 or 5 times a power of ten, at most a value.
function roundFactor(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return Math.max(1, Math.max(...[1, 2, 5].filter((digit) => digit * decade <= value)) * decade);
}

function arrow([x, y], [dx, dy], head) {
  const length = Math.hypot(dx, dy), tip = Math.min(head, 0.4 * length) / (length || 1), end = [x + dx, y + dy];
  const barb = (side) => [end[0] - tip * (dx + side * 0.6 * dy), end[1] - tip * (dy - side * 0.6 * dx)];
  return `M${x} ${y}L${end}M${barb(1)}L${end}L${barb(-1)}`;
}

// The ellipse of one standard deviation, enlarged.
function ellipse(x, y, [xx, xy, yy], factor) {
  const mean = (xx + yy) / 2, half = Math.hypot((xx - yy) / 2, xy), turn = (Math.atan2(2 * xy, xx - yy) / 2) * (180 / Math.PI);
  return h("ellipse", { rx: factor * Math.sqrt(mean + half), ry: factor * Math.sqrt(Math.max(mean - half, 0)), transform: `translate(${x} ${y}) rotate(${turn})` });
}
