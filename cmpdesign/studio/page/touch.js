// The part "Touch": a camera of this browser, or the source of "cmpdesign view", live: markers and arrows of one view,
// the surface and forces of several. One frame is drawn while the next is on its way.

import { ask, figures, h, number, toast } from "./base.js";
import { design } from "./state.js";
import { Surface } from "./surface.js";

const PLOT_FRAMES = 300, RATE_FRAMES = 30, TELL_MS = 200, STATUS_COLORS = ["", "#ffe94a", "#ff9d2e", "#ff8cff"], AXIS_COLORS = ["#e5484d", "#30a46c", "#4a7dff"];
const CAMERA_WORDS = { NotAllowedError: "The browser has no right to the camera: allow it in the address bar.", NotFoundError: "This machine has no camera that the browser can use.", NotReadableError: "Another program uses the camera; close it." };

export class TouchPart {
  constructor(start) {
    this.canvas = h("canvas", { role: "img", "aria-label": "The frame with its markers and displacements" });
    this.words = h("p", { class: "note" }, "No source yet.");
    this.video = h("video", { muted: true, playsinline: true, hidden: true });
    this.health = h("div", { class: "box" });
    this.plot = h("canvas", { class: "plot", role: "img", "aria-label": "Running plot" });
    this.plotWords = h("p", { class: "small soft words" });
    this.factor = h("input", { type: "range", min: 1, max: 30, step: 1, value: 5, id: "factor", oninput: () => this.#draw() });
    this.space = h("div", { class: "canvas" }, this.canvas);
    this.cameras = h("select", { "aria-label": "Camera of this machine" });
    this.kind = h("select", { "aria-label": "Format of the recording" }, start.recorded.map((kind) => h("option", { value: kind }, `.${kind}`)));
    this.record = h("button", { "aria-pressed": "false", disabled: true, onclick: () => this.socket?.send(this.isRecording ? "save" : `record ${this.kind.value}`) }, "● Record");
    this.rest = h("button", { disabled: true, onclick: () => this.socket?.send("rest") }, "This is rest");
    const button = (text, act, kind = "") => h("button", { class: kind, onclick: act }, text);
    this.element = h("div", { class: "work two" }, h("aside", { class: "side", "aria-label": "Source and health" },
      h("div", { class: "box" }, h("h2", {}, "Source"), start.live && button(`Show ${fileOf(start.live)}`, () => this.#openSource(), "primary"), button("Use the camera of this browser", () => this.#openCamera(), start.live ? "" : "primary"),
        h("div", { class: "row" }, h("span", { class: "grow" }, this.cameras), this.machine = button("Use", () => this.#openMachine())),
        h("div", { class: "row" }, this.rest, button("Stop", () => this.#stop("Stopped."))), h("div", { class: "row" }, this.record, h("span", { class: "grow" }, this.kind)), h("p", { class: "soft small" }, "The camera is read with the layout of the present design. Another source: cmpdesign view LAYOUT SOURCE.")),
      h("div", { class: "box" }, h("label", { for: "factor" }, "Arrows and heights, enlarged"), this.factor), h("div", { class: "box" }, h("h2", {}, "Running"), this.plot, this.plotWords), this.health), h("section", { class: "stage", "aria-label": "Live" }, this.space, this.words), this.video);
    this.isWanted = Boolean(start.live);
    this.#listCameras();
    new ResizeObserver(() => this.#draw()).observe(this.space);
  }

  // The cameras that this machine itself reads, at their own rate.
  async #listCameras() {
    const { cameras, problem } = await ask("/api/cameras").catch((error) => ({ cameras: [], problem: error.message }));
    this.cameras.replaceChildren(...(cameras.length ? cameras.map((one) => h("option", { value: one.number }, one.name)) : [h("option", {}, "No camera of this machine")]));
    this.cameras.disabled = this.machine.disabled = !cameras.length;
    this.cameras.title = problem;
  }

  refresh() { if (this.isWanted && !this.socket) { this.isWanted = false; this.#openSource(); } }

  #connect(path, onframe) {
    this.#stop("Connecting.");
    this.frame = this.image = null;
    this.hasForce = false;
    this.history = [];
    this.shownTimes = [];
    const socket = new WebSocket(`ws://${location.host}${path}`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (socket !== this.socket) return;
      if (typeof data !== "string") { onframe(data); return; }
      const told = JSON.parse(data);
      if (told.over !== undefined) this.#stop(told.over);
      else if (told.note !== undefined) { toast(told.note); this.#setRecording(false); }
      else if (told.recording) this.#setRecording(true);
      else if (told.saved) { this.#setRecording(false); this.#download(told); }
      else if (told.cells) { this.pad = told; this.words.textContent = told.name = fileOf(told.name); onframe(null); }
      else onframe(told);
    };
    socket.onclose = ({ reason }) => { if (socket === this.socket) this.#stop(reason || "The connection has ended."); };
    this.socket = socket;
    this.record.disabled = this.rest.disabled = false;
  }

  #send(data) { if (this.socket?.readyState === 1) this.socket.send(data); }

  // Displacements of one recording have one rest.
  #setRecording(isOn) {
    this.isRecording = isOn;
    this.record.setAttribute("aria-pressed", String(isOn));
    this.record.textContent = isOn ? "■ Save" : "● Record";
    this.rest.disabled = this.kind.disabled = isOn;
  }

  #download({ saved, name, frames }) {
    h("a", { href: `/api/recordings/${saved}`, download: name }).click();
    toast(`${frames} frames are in ${name}.`);
  }

  #openSource() { this.#follow("/live/source"); }
  #openMachine() { this.#follow(`/live/machine?${new URLSearchParams({ camera: this.cameras.value, fields: JSON.stringify(design.fields) })}`); }

  // A frame is a document and then its image. When both have come, the next is asked for.
  #follow(path) {
    let frame = null;
    this.#connect(path, async (data) => {
      if (data !== null && !(data instanceof ArrayBuffer)) { frame = data; return; }
      this.#send("next");
      if (data === null) return;
      const arrived = frame, image = data.byteLength ? await createImageBitmap(new Blob([data], { type: "image/jpeg" })) : null;
      this.#show(arrived, image);
    });
  }

  // One frame is read while the next is taken from the camera and encoded.
  async #openCamera() {
    if (!navigator.mediaDevices) { this.#stop("This browser gives no camera to this page."); return; }
    let stream;
    try { stream = await navigator.mediaDevices.getUserMedia({ video: { width: { ideal: 1280 } } }); } catch (error) { this.#stop(CAMERA_WORDS[error.name] ?? error.message); return; }
    const grab = new OffscreenCanvas(1, 1), take = async () => {
      await new Promise((done) => this.video.requestVideoFrameCallback(done));
      grab.width = this.video.videoWidth;
      grab.height = this.video.videoHeight;
      grab.getContext("2d").drawImage(this.video, 0, 0);
      const [picture, blob] = await Promise.all([createImageBitmap(grab), grab.convertToBlob({ type: "image/jpeg", quality: 0.95 })]);
      return [picture, await blob.arrayBuffer()];
    };
    let sent = null, next = take();
    this.#connect(`/live/camera?${new URLSearchParams({ fields: JSON.stringify(design.fields) })}`, async (told) => {
      if (told) this.#show(told, sent);
      const [picture, data] = await next;
      sent = picture;
      this.#send(data);
      next = take();
    });
    this.stream = stream;
    this.video.srcObject = stream;
    await this.video.play();
  }

  // The latest frame is drawn once the browser draws; words follow a few times a second.
  #show(frame, image) {
    this.frame = frame;
    this.image = image;
    this.drawing ??= requestAnimationFrame((now) => {
      this.drawing = null;
      this.#draw();
      this.#count(now);
      if (!this.socket || now - (this.toldMs ?? 0) > TELL_MS) { this.toldMs = now; this.#tell(); }
    });
  }

  #stop(text) {
    const socket = this.socket;
    this.socket = null;
    if (this.frame) this.#tell();
    socket?.close();
    for (const track of this.stream?.getTracks() ?? []) track.stop();
    this.stream = null;
    this.#setRecording(false);
    this.record.disabled = this.rest.disabled = true;
    this.words.textContent = text;
  }

  #draw() {
    const frame = this.frame, { clientWidth: width, clientHeight: height } = this.space;
    if (!frame || !width || !height) return;
    if (frame.in_space) {
      this.surface ??= new Surface();
      if (this.surface.canvas.parentElement !== this.space) this.space.replaceChildren(this.surface.canvas);
      this.surface.show(this.pad, frame, Number(this.factor.value), width, height);
      return;
    }
    if (this.canvas.parentElement !== this.space) this.space.replaceChildren(this.canvas);
    const ratio = devicePixelRatio, context = this.canvas.getContext("2d"), image = this.image;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) Object.assign(this.canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    const size = image ? [image.width, image.height] : [640, 480], scale = Math.min(width / size[0], height / size[1]) * ratio;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.setTransform(scale, 0, 0, scale, (this.canvas.width - scale * size[0]) / 2, (this.canvas.height - scale * size[1]) / 2);
    if (image) context.drawImage(image, 0, 0);
    context.translate(0.5, 0.5); // the centre of the top-left pixel is (0, 0)
    const factor = Number(this.factor.value), radius = (2.2 * ratio) / scale;
    context.lineWidth = (1.6 * ratio) / scale;
    context.strokeStyle = "#54f0ff";
    context.beginPath();
    frame.place.forEach(([x, y], at) => { const [dx, dy] = frame.moved[at]; context.moveTo(x, y); context.lineTo(x + factor * dx, y + factor * dy); });
    context.stroke();
    frame.place.forEach(([x, y], at) => { context.fillStyle = STATUS_COLORS[frame.status[at]]; context.fillRect(x - radius, y - radius, 2 * radius, 2 * radius); });
  }

  #count(now) {
    const { frame } = this, force = forceOf(frame);
    this.shownTimes = [...this.shownTimes.slice(1 - RATE_FRAMES), now];
    this.hasForce ||= Boolean(force);
    this.history.push(force ? { values: [...force.force_n, ...force.torque_nmm], sigmas: [...force.force_sigma_n, ...force.torque_sigma_nmm] } : { values: this.hasForce ? [] : [frame.largest_mm ?? NaN], sigmas: [] });
    this.history.splice(0, this.history.length - PLOT_FRAMES);
    if (this.socket) this.words.textContent = frame.tracked ? `${this.pad.name} · frame ${frame.index}` : "The pattern is not found.";
    this.#plotHistory();
  }

  #tell() {
    const { frame, shownTimes: times } = this, force = forceOf(frame), shown = times.length > 1 ? (1000 * (times.length - 1)) / (times.at(-1) - times[0]) : 0;
    const withSigma = (name, values, sigmas, unit) => values.map((value, at) => [`${name} ${"xyz"[at]}`, `${value.toFixed(3)} ± ${sigmas[at].toFixed(3)} ${unit}`]);
    const rows = [["Markers measured", `${frame.measured} of ${this.pad.markers}`], ["Reader", `${frame.elapsed_ms.toFixed(1)} ms`], ["Source", `${frame.frames_per_s.toFixed(1)} frames/s`], ["Shown", `${shown.toFixed(1)} frames/s`], ["Frame", frame.index],
      ["Largest displacement", frame.largest_mm === null ? "–" : `${number(frame.largest_mm, 3)} mm`]];
    if (force) rows.push(...withSigma("Force", force.force_n, force.force_sigma_n, "N"), ...withSigma("Torque", force.torque_nmm, force.torque_sigma_nmm, "N mm"), ["Pressure to", `${number(1e3 * Math.max(...force.pressure_mpa), 3)} kPa`], ["Shear to", `${number(1e3 * Math.max(...force.shear_mpa.map((by) => Math.hypot(...by))), 3)} kPa`], ["Contacts", force.regions.length], ...(force.utilisation === null ? [] : [["Of the friction", force.utilisation < 1 ? `${number(100 * force.utilisation, 2)} %` : "slips"]]));
    const notes = [...new Set([frame.reason, frame.contact?.reason, ...frame.hints].filter(Boolean))].map((text) => h("div", { class: `finding ${frame.tracked ? "warning" : "error"}` }, text));
    this.health.replaceChildren(h("h2", {}, "Health"), figures(rows), ...notes);
  }

  // Force and torque over the last frames with their deviations, or the largest displacement.
  #plotHistory() {
    const { clientWidth: width, clientHeight: height } = this.plot, ratio = devicePixelRatio, context = this.plot.getContext("2d");
    if (!width) return;
    Object.assign(this.plot, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    context.scale(ratio, ratio);
    const panels = this.hasForce ? [["Force, N", 0, 3], ["Torque, N mm", 3, 6]] : [["Largest displacement, mm", 0, 1]];
    this.plotWords.replaceChildren(...panels.map(([title, first, end], at) => {
      const [low, high] = this.#plotPanel(context, first, end, (at * height) / panels.length, width, height / panels.length);
      return h("span", {}, `${title}: ${number(low, 3)} to ${number(high, 3)}`);
    }), this.hasForce ? h("span", {}, "red x, green y, blue z; bands: deviations") : "");
  }

  // The values of a panel between their lowest and highest.
  #plotPanel(context, first, end, top, width, height) {
    const axes = [...Array(end - first).keys()], column = (axis) => this.history.map(({ values, sigmas }) => [values[first + axis] ?? NaN, sigmas[first + axis] ?? 0]);
    const columns = axes.map(column), known = columns.flat().map(([value]) => value).filter(Number.isFinite), low = Math.min(0, ...known), high = Math.max(1e-6, ...known);
    const x = (at) => (at / Math.max(RATE_FRAMES, this.history.length)) * width, y = (value) => top + height - 5 - ((value - low) / (high - low)) * (height - 10);
    columns.forEach((points, axis) => {
      context.strokeStyle = context.fillStyle = AXIS_COLORS[axis];
      context.globalAlpha = 0.25;
      points.forEach(([value, sigma], at) => { if (sigma > 0) context.fillRect(x(at), y(value + sigma), x(1), y(value - sigma) - y(value + sigma)); });
      context.globalAlpha = 1;
      context.beginPath();
      points.forEach(([value], at) => context.lineTo(x(at), y(value)));
      context.stroke();
    });
    return [low, high];
  }
}

const fileOf = (name) => name.split(/[\\/]/).at(-1);
const forceOf = (frame) => (frame.contact?.known ? frame.contact : null);
