// The form of a design, made from the design's JSON Schema: a new field of the schema appears without a new line here.

import { h, number, words } from "./base.js";
import { design } from "./state.js";

// Fields of the design itself by group; a field that no group names stands in the last.
const GROUPS = [
  ["Pattern and size", ["pattern", "layers", "pitch_mm", "width_mm", "height_mm", "border_mm", "rotation_deg", "mirrored", "aspect", "spacing", "virtual_per_edge"]],
  ["Code", ["code", "code_share"]],
  ["Clip", ["clip", "clip_width_mm", "clip_height_mm", "clip_diameter_mm"]],
  ["Name", ["name", "description", "source"]],
  ["SVG", ["print_ids", "print_scale", "print_mirror"]],
];
const UNITS = { _mm_s: "mm/s", _mm: "mm", _deg: "°", _percent: "%" };
const unitOf = (name) => UNITS[Object.keys(UNITS).find((suffix) => name.endsWith(suffix))] ?? "";

// What a field takes: its kind, limits, words, and the default.
function readKind(property) {
  const options = (property.anyOf ?? [property]).flatMap((one) => one.anyOf ?? [one]).filter((one) => one.type !== "null");
  const found = Object.assign({}, ...options, property);
  const types = options.map((one) => one.type);
  const kind = found.enum ? "words" : types.includes("boolean") ? "truth" : types.includes("integer") ? "whole" : types.includes("number") ? "number"
    : found.pattern?.includes("0-9a-fA-F") ? "color" : "text";
  return { ...found, kind, lowest: found.minimum ?? found.exclusiveMinimum ?? (found.pattern?.includes("[+-]") ? -180 : 0), isOptional: property.default === null };
}

export class DesignForm {
  constructor(schema) {
    this.rows = new Map();
    this.help = h("p", { class: "help", id: "help" }, "Point at a field to read what it means. Lengths also take a unit: 60mil, 0.2in.");
    const tables = Object.entries(schema.properties).filter(([, property]) => property.$ref);
    const plain = Object.keys(schema.properties).filter((name) => !schema.properties[name].$ref && name !== "extends");
    const grouped = new Set(GROUPS.flatMap(([, names]) => names));
    const other = plain.filter((name) => !grouped.has(name));
    const groups = [
      GROUPS[0],
      ...tables.map(([name, property]) => [name, Object.keys(schema.$defs[property.$ref.split("/").at(-1)].properties).map((inner) => `${name}.${inner}`)]),
      ...GROUPS.slice(1), ...(other.length ? [["More", other]] : []),
    ];
    const propertyOf = (dotted) => {
      const [table, inner] = dotted.split(".");
      return inner ? schema.$defs[schema.properties[table].$ref.split("/").at(-1)].properties[inner] : schema.properties[table];
    };
    this.form = h("form", { class: "design", onsubmit: (event) => event.preventDefault() }, groups.map(([title, names], at) =>
      h("details", { class: "group", open: at === 0 },
        h("summary", {}, title[0].toUpperCase() + title.slice(1), h("span", { class: "count soft small" })),
        names.map((name) => this.#row(name, readKind(propertyOf(name)))))));
    this.element = [this.form, this.help];
    design.listen(() => this.refresh());
    this.refresh();
  }

  #row(dotted, kind) {
    const id = `f-${dotted.replace(".", "-")}`, name = dotted.split(".").at(-1);
    const row = { dotted, kind, reset: h("button", { type: "button", class: "icon", "aria-label": `Reset ${words(name)}`, title: "Reset", onclick: () => design.set(dotted, undefined) }, "↺") };
    const give = (value) => design.set(dotted, value);
    const common = { id, "aria-describedby": "help" };
    if (kind.kind === "words") {
      const none = kind.isOptional || !("default" in kind) ? [h("option", { value: "" }, "–")] : [];
      row.input = h("select", { ...common, onchange: (event) => give(event.target.value === "" ? undefined : kind.enum.find((word) => String(word) === event.target.value)) },
        none, kind.enum.map((word) => h("option", { value: word }, String(word))));
    } else if (kind.kind === "truth") {
      row.input = h("input", { ...common, type: "checkbox", onchange: (event) => give(event.target.checked) });
    } else {
      const isNumber = kind.kind === "whole" || kind.kind === "number";
      const parse = (text) => (text.trim() === "" ? undefined : isNumber && Number.isFinite(Number(text)) ? Number(text) : text);
      row.input = h("input", { ...common, type: kind.kind === "color" ? "color" : "text", inputmode: isNumber ? "decimal" : null, spellcheck: "false", autocomplete: "off",
        [kind.kind === "color" ? "oninput" : "onchange"]: (event) => give(parse(event.target.value)) });
      if (isNumber) row.slider = h("input", { type: "range", "aria-label": `${words(name)}, slider`, oninput: (event) => give(Number(event.target.value)) });
    }
    row.element = h("div", { class: "field", onpointerenter: () => this.#tell(row), onfocusin: () => this.#tell(row) },
      h("label", { for: id }, words(name)), h("span", { class: "entry" }, row.input, unitOf(name) && h("span", { class: "unit" }, unitOf(name))), row.reset, row.slider);
    this.rows.set(dotted, row);
    return row.element;
  }

  #tell({ dotted, kind, note }) {
    const limits = [kind.minimum !== undefined && `from ${kind.minimum}`, kind.exclusiveMinimum !== undefined && `above ${kind.exclusiveMinimum}`, kind.maximum !== undefined && `to ${kind.maximum}`].filter(Boolean).join(" ");
    const usual = kind.default === null || kind.default === undefined ? "" : `usually ${kind.default}`;
    this.help.replaceChildren(h("b", {}, dotted), ` ${kind.description ?? ""} `, h("span", { class: "soft" }, [limits, usual].filter(Boolean).join("; ")), note ? h("div", {}, note) : "");
  }

  // The values of the design, and for fields without a value the usual or the resolved value.
  refresh(resolved = this.resolved ?? {}) {
    this.resolved = resolved;
    for (const row of this.rows.values()) {
      const value = design.get(row.dotted), shown = value ?? row.kind.default ?? resolved[row.dotted] ?? "";
      row.element.classList.toggle("set", value !== undefined);
      row.reset.disabled = value === undefined || !("default" in row.kind);
      if (row.kind.kind === "truth") row.input.checked = Boolean(shown);
      else if (row.kind.kind === "text" || row.slider) {
        if (document.activeElement !== row.input) row.input.value = value ?? "";
        row.input.placeholder = value === undefined && shown !== "" && shown !== null ? (row.slider ? number(shown) : shown) : "–";
      } else row.input.value = shown ?? "";
      if (row.slider) {
        row.slider.hidden = value === undefined && row.kind.isOptional;
        this.#setSlider(row, Number(shown));
      }
    }
    for (const group of this.form.children) {
      const count = group.querySelectorAll(".field.set").length;
      group.querySelector(".count").textContent = count ? `${count} set` : "";
    }
  }

  #setSlider(row, value) {
    const known = Number.isFinite(value) ? value : 0, { slider, kind } = row;
    if (!slider.max || slider.dataset.max === undefined || known > Number(slider.max) || known < Number(slider.min)) {
      const wide = Math.max(3 * Math.abs(known), kind.kind === "whole" ? 10 : 0.3), decade = 10 ** Math.floor(Math.log10(wide));
      const top = Math.min(kind.maximum ?? Infinity, kind.lowest < 0 ? 180 : Math.ceil(wide / decade) * decade);
      slider.min = kind.lowest;
      slider.max = slider.dataset.max = top;
      slider.step = kind.kind === "whole" ? 1 : Number(((top - kind.lowest) / 300).toPrecision(1));
    }
    if (document.activeElement !== slider || Number(slider.value) !== known) slider.value = known;
  }

  // Marks the fields that findings or an error name; words of the error stand in the help line.
  mark(findings) {
    for (const row of this.rows.values()) {
      const own = findings.filter((finding) => finding.fields.includes(row.dotted));
      row.note = own.map((finding) => finding.text).join("; ");
      row.element.classList.toggle("error", own.some((finding) => finding.severity === "error"));
      row.element.classList.toggle("warning", own.length > 0 && !own.some((finding) => finding.severity === "error"));
      row.input.setAttribute("aria-invalid", String(own.some((finding) => finding.severity === "error")));
    }
  }

  focus(dotted) {
    const row = this.rows.get(dotted);
    if (!row) return;
    row.element.closest("details").open = true;
    row.input.focus();
    row.element.scrollIntoView({ block: "center" });
  }
}
