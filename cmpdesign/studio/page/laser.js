// The laser job as the beam runs: cuts and travel up to a moment, and the cells as made.

import { ask, h, number } from "./base.js";
import { Stage } from "./stage.js";
import { design } from "./state.js";

const SPEEDUP = 8;
const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

export class Laser {
  constructor() {
    this.stage = new Stage("Paths of the laser");
    this.look = { travel: true, made: false };
    const toggle = (text, name) => h("button", { "aria-pressed": String(this.look[name]), onclick: (event) => { this.look[name] = !this.look[name]; event.target.setAttribute("aria-pressed", String(this.look[name])); this.draw(); } }, text);
    this.time = h("input", { type: "range", min: 0, max: 1, step: "any", value: 1, class: "grow", "aria-label": "Time of the job", oninput: () => this.draw() });
    this.play = h("button", { onclick: () => this.#play() }, "▶ Play");
    this.words = h("span", { class: "small soft mono" });
    this.kerf = h("input", { type: "range", min: 0, max: 0.4, step: 0.005, "aria-label": "Kerf, mm", oninput: () => { design.set("laser", { ...withoutKerf(), kerf_mm: Number(this.kerf.value) }); this.refresh(); } });
    this.kerfWords = h("span", { class: "small soft" });
    this.problem = h("p", { class: "finding error", role: "alert", hidden: true });
    this.element = h("div", { class: "panel" }, this.problem, this.stage.element, h("div", { class: "bar" }, this.play, this.time, this.words),
      h("div", { class: "bar" }, toggle("Travel", "travel"), toggle("As made", "made"), h("label", { class: "row" }, "Kerf ", this.kerf), this.kerfWords, h("span", { class: "gap" }), this.stage.buttons()));
  }

  async refresh() {
    if (this.busy) { this.isStale = true; return; }
    this.busy = true;
    do {
      this.isStale = false;
      try {
        this.job = await ask("/api/laser", { body: { fields: design.fields } });
        this.problem.hidden = true;
      } catch (error) { this.problem.hidden = false; this.problem.textContent = error.message; }
    } while (this.isStale);
    this.busy = false;
    if (this.job) this.draw();
  }

  draw() {
    const { passes, size_mm: [width, height], made, kerf_mm: kerf, assumed } = this.job;
    const total = passes.reduce((sum, one) => sum + one.end_s, 0), now = Number(this.time.value) * total;
    let before = 0, current = passes[0], head = null;
    const layers = this.look.made ? [h("path", { class: "made", d: made.map((ring) => `M${ring.join("L")}Z`).join("") })] : [];
    for (const one of passes) {
      const local = now - before, count = one.begin_s.filter((begin) => begin < local).length;
      before += one.end_s;
      if (!count) continue;
      current = one;
      const done = one.strokes.slice(0, count), isOver = local >= one.end_s;
      if (!isOver) {
        const next = one.begin_s[count] ?? one.end_s, share = Math.min((local - one.begin_s[count - 1]) / (next - one.begin_s[count - 1]), 1);
        done[count - 1] = partOf(done[count - 1], share);
        head = done[count - 1].at(-1);
      }
      layers.push(h("path", { class: "cut", stroke: one.color, d: done.map((stroke) => `M${stroke.join("L")}`).join("") }));
      if (this.look.travel) layers.push(h("path", { class: "travel", d: done.slice(1).map((stroke, at) => `M${done[at].at(-1)}L${stroke[0]}`).join("") }));
    }
    if (head) layers.push(h("circle", { cx: head[0], cy: head[1], r: width / 120, fill: "#ff3b30" }));
    const margin = 0.04 * Math.max(width, height);
    this.stage.show([-margin, -margin, width + 2 * margin, height + 2 * margin], ...layers);
    const wholly = passes.reduce((sum, one) => sum + one.time_s, 0);
    this.words.textContent = `${clock(now)} of ${clock(total)} · ${current.name}${current.repeats > 1 ? ` (of ${current.repeats} repeats)` : ""} · all repeats ${clock(wholly)}`;
    this.kerf.value = kerf;
    this.kerfWords.textContent = `${number(kerf, 3)} mm${assumed.some((name) => name.startsWith("kerf")) ? ", assumed" : ""}`;
  }

  #play() {
    if (this.running) { cancelAnimationFrame(this.running); this.running = 0; this.play.textContent = "▶ Play"; return; }
    if (Number(this.time.value) >= 1) this.time.value = 0;
    this.play.textContent = "❚❚ Pause";
    const total = this.job.passes.reduce((sum, one) => sum + one.end_s, 0);
    let last = performance.now();
    const step = (ms) => {
      this.time.value = Number(this.time.value) + ((ms - last) / 1000) * (SPEEDUP / total);
      last = ms;
      this.draw();
      if (Number(this.time.value) >= 1 || !this.element.isConnected) { this.running = 1; this.#play(); } else this.running = requestAnimationFrame(step);
    };
    this.running = requestAnimationFrame(step);
  }
}

// The beginning of a stroke, by its share of the length.
function partOf(stroke, share) {
  const lengths = stroke.slice(1).map((point, at) => Math.hypot(point[0] - stroke[at][0], point[1] - stroke[at][1]));
  let left = share * lengths.reduce((sum, one) => sum + one, 0);
  const part = [stroke[0]];
  for (const [at, length] of lengths.entries()) {
    const ratio = length ? Math.min(left / length, 1) : 1;
    part.push([0, 1].map((axis) => stroke[at][axis] + ratio * (stroke[at + 1][axis] - stroke[at][axis])));
    left -= length;
    if (left <= 0) break;
  }
  return part;
}

function withoutKerf() {
  const { kerf_x_mm, kerf_y_mm, ...others } = design.fields.laser ?? {};
  return others;
}
