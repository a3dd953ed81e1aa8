// The page: its parts, one shown at a time by the address, undo and redo, light and dark.

import { ask, h, toast } from "./base.js";
import { DesignPart } from "./design.js";
import { MakePart } from "./make.js";
import { ReadPart } from "./read.js";
import { StartPart } from "./start.js";
import { design } from "./state.js";
import { TouchPart } from "./touch.js";

const PARTS = { start: StartPart, design: DesignPart, make: MakePart, read: ReadPart, touch: TouchPart };
const content = document.getElementById("content"), tabs = document.getElementById("tabs"), made = {};
const undo = document.getElementById("undo"), redo = document.getElementById("redo");

function chooseTheme(name) {
  document.documentElement.dataset.theme = name ?? localStorage.getItem("cmpdesign.theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
}

function refreshTools() {
  undo.disabled = !design.canUndo;
  redo.disabled = !design.canRedo;
  for (const link of tabs.children) link.href = design.link(`#/${link.dataset.part}`);
}

function show(start) {
  const name = /^#\/(\w+)/.exec(location.hash)?.[1], part = name in PARTS ? name : "start";
  const title = [...tabs.children].find((link) => link.dataset.part === part).textContent;
  made[part] ??= new PARTS[part](start);
  content.replaceChildren(h("h1", { class: "skip" }, title), made[part].element);
  for (const link of tabs.children) link.dataset.part === part ? link.setAttribute("aria-current", "page") : link.removeAttribute("aria-current");
  document.title = `${title} · cmpdesign studio`;
  made[part].shown?.();
  made[part].refresh?.();
}

async function begin() {
  chooseTheme();
  design.readLink();
  const start = await ask("/api/start");
  document.getElementById("theme").addEventListener("click", () => {
    const name = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    localStorage.setItem("cmpdesign.theme", name);
    chooseTheme(name);
  });
  undo.addEventListener("click", () => design.undo());
  redo.addEventListener("click", () => design.redo());
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.target.matches("textarea, input[type=text]")) return;
    const key = event.key.toLowerCase();
    if (key === "z" || key === "y") { event.preventDefault(); key === "y" || event.shiftKey ? design.redo() : design.undo(); }
  });
  design.listen(refreshTools);
  refreshTools();
  addEventListener("hashchange", () => show(start));
  show(start);
}

begin().catch((error) => { content.replaceChildren(h("p", { class: "empty", role: "alert" }, error.message)); toast(error.message); });
