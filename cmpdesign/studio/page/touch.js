// The part "Touch": a camera of this browser, or the source of "cmpdesign view", live: markers and arrows of one view,
// the surface and forces of several. One frame is drawn while the next is on its way.

import { ask, figures, h, number, toast, unpack } from "./base.js";
import { design } from "./state.js";
import { Surface } from "./surface.js";

const PLOT_FRAMES = 300, RATE_FRAMES = 30, TELL_MS = 200, STATUS_COLORS = ["", "#ffe94a", "#ff9d2e", "#ff8cff"], AXIS_COLORS = ["#e5484d", "#30a46c", "#4a7dff"];
const CAMERA_WORDS = { NotAllowedError: "The browser has no right to the camera: allow it in the address bar.", NotFoundError: "This machine has no camera that the browser can use.", NotReadableError: "Another program uses the camera; close it." };

export class TouchPart {
  constructor(start) {
    this.surface = new Surface(() => this.#draw());
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
      if (typeof data !== "string") { onframe(unpack(data)); return; }
      const told = JSON.parse(data);
      if (told.over !== undefined) this.#stop(told.over);
      else if (told.note !== undefined) { toast(told.note); this.#setRecording(false); }
      else if (told.recording) this.#setRecording(true);
      else if (told.saved) { this.#setRecording(false); this.#download(told); }
      else { this.pad = told; this.words.textContent = told.name = fileOf(told.name); onframe(null); }
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

  // When a frame is drawn, the next is asked for: the server sends the newest one.
  #follow(path) {
    this.#connect(path, async (frame) => {
      if (frame === null) { this.#send("next"); return; }
      const takenMs = performance.now() - frame.age_ms;
      this.#show(frame, frame.rest.length ? await createImageBitmap(new Blob([frame.rest], { type: "image/jpeg" })) : null, takenMs, () => this.#send("next"));
    });
  }

  // One frame is read while the next is taken from the camera and encoded.
  async #openCamera() {
    if (!navigator.mediaDevices) { this.#stop("This browser gives no camera to this page."); return; }
    let stream;
    try { stream = await navigator.mediaDevices.getUserMedia({ video: { width: { ideal: 1280 } } }); } catch (error) { this.#stop(CAMERA_WORDS[error.name] ?? error.message); return; }
    const grab = new OffscreenCanvas(1, 1), take = async () => {
      const takenMs = await new Promise((done) => this.video.requestVideoFrameCallback(done));
      grab.width = this.video.videoWidth;
      grab.height = this.video.videoHeight;
      grab.getContext("2d").drawImage(this.video, 0, 0);
      const [picture, blob] = await Promise.all([createImageBitmap(grab), grab.convertToBlob({ type: "image/jpeg", quality: 0.95 })]);
      return [picture, await blob.arrayBuffer(), takenMs];
    };
    let sent = null, sentMs = 0, next = take();
    this.#connect(`/live/camera?${new URLSearchParams({ fields: JSON.stringify(design.fields) })}`, async (frame) => {
      if (frame) this.#show(frame, sent, sentMs);
      const [picture, data, takenMs] = await next;
      [sent, sentMs] = [picture, takenMs];
      this.#send(data);
      next = take();
    });
    this.stream = stream;
    this.video.srcObject = stream;
    await this.video.play();
  }

  // The latest frame is drawn once the browser draws; words and plot follow a few times a second.
  #show(frame, image, takenMs, ondraw = () => {}) {
    Object.assign(this, { frame, image, takenMs });
    this.drawing ??= requestAnimationFrame((now) => {
      this.drawing = null;
      if (!this.frame) return;
      ondraw();
      this.#draw();
      this.#count(now);
      if (!this.socket || now - (this.toldMs ?? 0) > TELL_MS) { this.toldMs = now; this.#tell(); this.#plotHistory(); }
    });
  }

  #stop(text) {
    const socket = this.socket;
    this.socket = null;
    if (this.frame) { this.#tell(); this.#plotHistory(); }
    socket?.close();
    for (const track of this.stream?.getTracks() ?? []) track.stop();
    this.stream = null;
    this.#setRecording(false);
    this.record.disabled = this.rest.disabled = true;
    this.words.textContent = text;
  }

  #draw() {
    const { frame, image } = this, factor = Number(this.factor.value), canvas = frame?.in_space ? this.surface.canvas : this.canvas;
    if (!frame || !this.space.clientWidth || !this.space.clientHeight) return;
    if (canvas.parentElement !== this.space) this.space.replaceChildren(canvas);
    const { context, width, height } = cleared(canvas, this.space);
    if (frame.in_space) { this.surface.draw(context, this.pad, frame, factor, width, height); return; }
    const size = image ? [image.width, image.height] : [640, 480], scale = Math.min(width / size[0], height / size[1]);
    context.translate((width - scale * size[0]) / 2, (height - scale * size[1]) / 2);
    context.scale(scale, scale);
    if (image) context.drawImage(image, 0, 0);
    context.translate(0.5, 0.5); // the centre of the top-left pixel is (0, 0)
    const { place, moved, status } = frame, radius = 2.2 / scale;
    context.lineWidth = 1.6 / scale;
    context.strokeStyle = "#54f0ff";
    context.beginPath();
    for (let k = 0; k < place.length; k += 2) { context.moveTo(place[k], place[k + 1]); context.lineTo(place[k] + factor * moved[k], place[k + 1] + factor * moved[k + 1]); }
    context.stroke();
    for (let k = 0; k < place.length; k += 2) { context.fillStyle = STATUS_COLORS[status[k / 2]]; context.fillRect(place[k] - radius, place[k + 1] - radius, 2 * radius, 2 * radius); }
  }

  #count(now) {
    const { frame } = this, force = forceOf(frame);
    this.shownTimes = [...this.shownTimes.slice(1 - RATE_FRAMES), now];
    this.ageMs = performance.now() - this.takenMs;
    this.hasForce ||= Boolean(force);
    this.history.push(force ? { values: [...force.force_n, ...force.torque_nmm], sigmas: [...force.force_sigma_n, ...force.torque_sigma_nmm] } : { values: this.hasForce ? [] : [frame.largest_mm ?? NaN], sigmas: [] });
    this.history.splice(0, this.history.length - PLOT_FRAMES);
    if (this.socket) this.words.textContent = frame.tracked ? `${this.pad.name} · frame ${frame.index}` : "The pattern is not found.";
  }

  #tell() {
    const { frame, shownTimes: times } = this, force = forceOf(frame), shown = times.length > 1 ? (1000 * (times.length - 1)) / (times.at(-1) - times[0]) : 0;
    const withSigma = (name, values, sigmas, unit) => values.map((value, at) => [`${name} ${"xyz"[at]}`, `${value.toFixed(3)} ± ${sigmas[at].toFixed(3)} ${unit}`]);
    const rows = [["Markers measured", `${frame.measured} of ${this.pad.markers}`], ["Reader", `${frame.elapsed_ms.toFixed(1)} ms`], ["Source", `${frame.frames_per_s.toFixed(1)} frames/s`], ["Shown", `${shown.toFixed(1)} frames/s`], ["Age when shown", `${this.ageMs.toFixed(0)} ms`], ["Frame", frame.index],
      ["Largest displacement", frame.largest_mm === null ? "–" : `${number(frame.largest_mm, 3)} mm`]];
    if (force) rows.push(...withSigma("Force", force.force_n, force.force_sigma_n, "N"), ...withSigma("Torque", force.torque_nmm, force.torque_sigma_nmm, "N mm"), ["Pressure to", `${number(1e3 * force.max_pressure_mpa, 3)} kPa`], ["Shear to", `${number(1e3 * force.max_shear_mpa, 3)} kPa`], ["Contacts", force.regions.length], ...(force.utilisation === null ? [] : [["Of the friction", force.utilisation < 1 ? `${number(100 * force.utilisation, 2)} %` : "slips"]]));
    const notes = [...new Set([frame.reason, frame.contact?.reason, ...frame.hints].filter(Boolean))].map((text) => h("div", { class: `finding ${frame.tracked ? "warning" : "error"}` }, text));
    this.health.replaceChildren(h("h2", {}, "Health"), figures(rows), ...notes);
  }

  // Force and torque over the last frames with their deviations, or the largest displacement.
  #plotHistory() {
    if (!this.plot.clientWidth) return;
    const { context, width, height } = cleared(this.plot, this.plot), panels = this.hasForce ? [["Force, N", 0, 3], ["Torque, N mm", 3, 6]] : [["Largest displacement, mm", 0, 1]];
    this.plotWords.replaceChildren(...panels.map(([title, first, end], at) => {
      const [low, high] = this.#plotPanel(context, first, end, (at * height) / panels.length, width, height / panels.length);
      return h("span", {}, `${title}: ${number(low, 3)} to ${number(high, 3)}`);
    }), this.hasForce ? h("span", {}, "red x, green y, blue z; bands: deviations") : "");
  }

  // The values of a panel between their lowest and highest, each with a band of one deviation to both sides.
  #plotPanel(context, first, end, top, width, height) {
    const axes = [...Array(end - first).keys()], known = this.history.flatMap(({ values }) => values.slice(first, end)).filter(Number.isFinite), low = Math.min(0, ...known), high = Math.max(1e-6, ...known);
    const x = (at) => (at / Math.max(RATE_FRAMES, this.history.length)) * width, y = (value) => top + height - 5 - ((value - low) / (high - low)) * (height - 10);
    for (const axis of axes) {
      const points = this.history.map(({ values, sigmas }, at) => ({ at, value: values[first + axis], sigma: sigmas[first + axis] })).filter(({ value }) => Number.isFinite(value));
      const line = (side) => points.map(({ at, value, sigma }) => [x(at), y(value + side * (sigma || 0))]);
      context.strokeStyle = context.fillStyle = AXIS_COLORS[axis];
      context.globalAlpha = 0.25;
      context.fill(pathOf([...line(1), ...line(-1).reverse()]));
      context.globalAlpha = 1;
      context.stroke(pathOf(line(0)));
    }
    return [low, high];
  }
}

// An empty canvas as large as a box of the page; its units are those of the page.
function cleared(canvas, { clientWidth: width, clientHeight: height }) {
  const ratio = devicePixelRatio, [across, down] = [Math.round(width * ratio), Math.round(height * ratio)], context = canvas.getContext("2d");
  if (canvas.width !== across || canvas.height !== down) Object.assign(canvas, { width: across, height: down });
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

function pathOf(points) {
  const path = new Path2D();
  for (const point of points) path.lineTo(...point);
  return path;
}

const fileOf = (name) => name.split(/[\\/]/).at(-1);
const forceOf = (frame) => (frame.contact?.known ? frame.contact : null);
