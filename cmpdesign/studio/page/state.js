// The design of the page: one object of fields, with its history; it is in the address, so that a link is the design.

const RECENT = "cmpdesign.recent", MAX_RECENT = 6, MAX_STEPS = 200, ONE_STEP_MS = 700;

class DesignState {
  fields = { pattern: "honeycomb", layers: 10, pitch_mm: 1.5 };
  camera = [640, 480];
  #past = []; #future = []; #listeners = new Set(); #last = { name: "", ms: 0 };

  listen(listener) { this.#listeners.add(listener); return () => this.#listeners.delete(listener); }
  get canUndo() { return this.#past.length > 0; }
  get canRedo() { return this.#future.length > 0; }

  // Moves of one slider within a moment are one step of the history.
  change(fields, name = "") {
    const now = performance.now();
    if (!name || name !== this.#last.name || now - this.#last.ms > ONE_STEP_MS) {
      this.#past.push(this.fields);
      this.#past.splice(0, this.#past.length - MAX_STEPS);
    }
    this.#last = { name, ms: now };
    this.#future = [];
    this.#take(fields);
  }

  get(dotted) { return dotted.split(".").reduce((table, name) => table?.[name], this.fields); }

  set(dotted, value) {
    const fields = structuredClone(this.fields), names = dotted.split("."), last = names.pop();
    const table = names.reduce((inner, name) => (inner[name] ??= {}), fields);
    if (value === undefined) delete table[last]; else table[last] = value;
    if (names.length && !Object.keys(table).length) delete fields[names[0]];
    this.change(fields, dotted);
  }

  open(fields) { this.change(structuredClone(fields)); this.remember(); }
  setCamera(camera) { this.camera = camera; this.#take(this.fields); }
  undo() { if (this.canUndo) { this.#future.push(this.fields); this.#last.name = ""; this.#take(this.#past.pop()); } }
  redo() { if (this.canRedo) { this.#past.push(this.fields); this.#last.name = ""; this.#take(this.#future.pop()); } }

  #take(fields) {
    this.fields = fields;
    history.replaceState(null, "", this.link(location.hash.split("?")[0] || "#/start"));
    for (const listener of this.#listeners) listener(this);
  }

  link(part) {
    const text = JSON.stringify({ fields: this.fields, camera: this.camera });
    const binary = String.fromCharCode(...new TextEncoder().encode(text));
    return `${part}?d=${btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
  }

  readLink() {
    const found = /[?&]d=([\w-]+)/.exec(location.hash);
    if (!found) return;
    try {
      const binary = atob(found[1].replaceAll("-", "+").replaceAll("_", "/"));
      const given = JSON.parse(new TextDecoder().decode(Uint8Array.from(binary, (letter) => letter.charCodeAt(0))));
      this.fields = given.fields ?? this.fields;
      this.camera = given.camera ?? this.camera;
    } catch { /* not an address of this page: the usual design stays */ }
  }

  remember() {
    const text = JSON.stringify(this.fields);
    const kept = [this.fields, ...this.recent().filter((one) => JSON.stringify(one) !== text)].slice(0, MAX_RECENT);
    try { localStorage.setItem(RECENT, JSON.stringify(kept)); } catch { /* no storage: no list */ }
  }

  recent() {
    try { return JSON.parse(localStorage.getItem(RECENT)) ?? []; } catch { return []; }
  }
}

export const design = new DesignState();
