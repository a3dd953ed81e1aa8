// The part "Start": which pad for my camera, the templates with their pictures, and recent designs.

import { ask, figures, h, told } from "./base.js";
import { design } from "./state.js";

export class StartPart {
  constructor(start) {
    this.answer = h("div", { class: "wide", "aria-live": "polite" });
    const field = (name, label, value, hint) => h("label", {}, label, h("input", { name, value, placeholder: hint, required: name !== "error" }));
    const question = h("form", { class: "ask", onsubmit: (event) => { event.preventDefault(); this.#propose(new FormData(question)); } },
      field("camera", "Camera, px", "1280x960", "1280x960"), field("view", "Field of view, mm", "24x18", "24x18mm"),
      h("label", {}, "Made by", h("select", { name: "make" }, [["", "not decided"], ["laser", "laser"], ["mold", "mold"], ["print", "print"]].map(([value, text]) => h("option", { value }, text)))),
      field("error", "Largest error, if any", "", "0.2um"), h("button", { class: "primary" }, "Propose a pad"), this.answer);
    this.recent = h("section", { hidden: true });
    const card = (template) => h("button", { class: "card", onclick: () => open(template.fields) },
      h("img", { src: `/api/templates/${template.name}.svg`, alt: "", loading: "lazy" }), h("span", {}, h("b", {}, template.name), h("span", { class: "soft small" }, template.description)));
    this.element = h("div", { class: "start" },
      h("div", { class: "hero" }, h("h2", { class: "title" }, "A pad for your tactile sensor"), h("p", { class: "soft" }, "Choose a pattern, see what can be made and read, build its files, and read its pictures. All of it stays on this machine.")),
      h("section", {}, h("h2", {}, "Which pad for my camera?"), question),
      h("section", {}, h("h2", {}, "Templates"), h("div", { class: "cards" }, start.templates.map(card))), this.recent);
    for (const section of this.element.querySelectorAll("section")) section.firstChild?.classList.add("heading");
  }

  shown() {
    const kept = design.recent();
    this.recent.hidden = kept.length === 0;
    this.recent.replaceChildren(h("h2", { class: "heading" }, "Recent designs"), h("div", { class: "row" }, kept.map((fields) =>
      h("button", { onclick: () => open(fields) }, `${fields.name || fields.pattern}, ${fields.layers ? `${fields.layers} layers` : `pitch ${fields.pitch_mm} mm`}`))));
  }

  #propose(form) {
    return told(async () => {
      this.answer.replaceChildren(h("p", { class: "soft" }, "Proposing."));
      try {
        const found = await ask("/api/size", { body: Object.fromEntries(form) });
        this.answer.replaceChildren(figures(Object.entries(found.figures), "words"), h("div", { class: "row" }, h("button", { type: "button", class: "primary", onclick: () => open(found.fields) }, "Open this design")));
      } catch (error) { this.answer.replaceChildren(h("p", { class: "finding error", role: "alert" }, error.message)); }
    });
  }
}

function open(fields) {
  design.open(fields);
  location.hash = design.link("#/design");
}
