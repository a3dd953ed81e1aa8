// The surface of several views: the pad's cells at the places of their markers, redder where it is pressed, with a line
// along the shear. It is drawn in two dimensions from the back to the front: without a graphics card a 3-D context costs
// several times as much.

import { h } from "./base.js";

const PRESSED = [255, 32, 32], SHEAR_COLOR = "#ffe94a", MIN_SHEAR = 0.04; // of the largest
const LIGHT = [-0.41, 0.41, 0.82], AMBIENT = 0.35, DIRECT = 0.8, HAZE = 14; // a flat cell has about its own color; black cells stand out from a dark page
const DISTANCE = 3.7, FOCAL = 1.6, SEAM_PX = 0.5; // of the camera in radii of the pad, in sizes of the canvas; cells overlap so that no gap shows
const STEP = Math.PI / 24, TURNS = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };

export class Surface {
  // onturn: called when the view has changed.
  constructor(onturn) {
    this.canvas = h("canvas", { role: "img", tabindex: 0, "aria-label": "The surface; drag or arrow keys turn it, wheel or + and - zoom" });
    Object.assign(this, { onturn, turn: 0, tilt: Math.PI / 4, zoom: 1 });
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("pointermove", ({ buttons, movementX, movementY }) => { if (buttons) this.#turn(-movementX / 150, movementY / 150); });
    this.canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.#turn(0, 0, Math.exp(-event.deltaY * 0.0015)); }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const zoom = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
      if (!TURNS[event.key] && !zoom) return;
      event.preventDefault();
      this.#turn(...(TURNS[event.key] ?? [0, 0]), zoom);
    });
  }

  #turn(turn, tilt, zoom = 1) {
    this.turn += turn;
    this.tilt = Math.min(Math.max(this.tilt + tilt, -Math.PI / 2), Math.PI / 2);
    this.zoom = Math.min(Math.max(this.zoom * zoom, 0.3), 20);
    this.onturn();
  }

  // Markers move from their place at rest by their displacement, enlarged. Cells of lost markers are left out.
  draw(context, pad, frame, factor, width, height) {
    if (this.pad !== pad) this.#begin(pad);
    const { xyz, screen, row } = this;
    row.fill(-1);
    frame.ids.forEach((id, at) => { row[id] = at; });
    for (let k = 0; k < frame.place.length; k += 1) xyz[k] = frame.place[k] + (factor - 1) * frame.moved[k];
    this.#project(frame.ids.length, width, height);
    const shown = this.triangles.filter(({ ids }) => ids.every((id) => row[id] >= 0)), most = frame.pressure_mpa?.reduce((one, other) => Math.max(one, other), 1e-3);
    for (const one of shown) one.depth = one.ids.reduce((sum, id) => sum + screen[3 * row[id] + 2], 0);
    shown.sort((one, other) => one.depth - other.depth);
    for (const { ids, rgb } of shown) {
      const corners = ids.map((id) => row[id]), press = most ? (0.85 * corners.reduce((sum, at) => sum + Math.max(0, frame.pressure_mpa[at]), 0)) / 3 / most : 0, light = this.#light(corners);
      context.fillStyle = `rgb(${rgb.map((value, axis) => Math.round(HAZE + light * (value + press * (PRESSED[axis] - value))))})`;
      this.#fill(context, corners);
    }
    if (frame.shear_mpa) this.#drawShear(context, frame, width, height);
  }

  // Places in space to places on the canvas, and the depth, which is larger in front.
  #project(count, width, height) {
    const { xyz, screen } = this, [sine, cosine, down, up] = [Math.sin(this.turn), Math.cos(this.turn), Math.sin(this.tilt), Math.cos(this.tilt)];
    const away = DISTANCE * this.radius, focal = FOCAL * this.zoom * Math.min(width, height);
    for (let k = 0; k < 3 * count; k += 3) {
      const [x, y, z] = [cosine * xyz[k] + sine * xyz[k + 1], cosine * xyz[k + 1] - sine * xyz[k], xyz[k + 2]], depth = z * down - y * up, scale = focal / Math.max(away - depth, 0.1 * away);
      screen[k] = width / 2 + scale * x;
      screen[k + 1] = height / 2 - scale * (y * down + z * up);
      screen[k + 2] = depth;
    }
  }

  // How bright a cell is, by its direction in space.
  #light([first, second, third]) {
    const { xyz } = this, at = (corner, axis) => xyz[3 * corner + axis] - xyz[3 * first + axis];
    const [ax, ay, az, bx, by, bz] = [at(second, 0), at(second, 1), at(second, 2), at(third, 0), at(third, 1), at(third, 2)];
    const normal = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], length = Math.hypot(...normal) * Math.sign(normal[2] || 1) || 1;
    return AMBIENT + DIRECT * Math.max(0, normal.reduce((sum, value, axis) => sum + (value * LIGHT[axis]) / length, 0));
  }

  #fill(context, corners) {
    const { screen } = this, middle = [0, 1].map((axis) => corners.reduce((sum, at) => sum + screen[3 * at + axis], 0) / 3);
    context.beginPath();
    for (const at of corners) {
      const x = screen[3 * at] - middle[0], y = screen[3 * at + 1] - middle[1], wider = 1 + SEAM_PX / Math.max(Math.hypot(x, y), 1);
      context.lineTo(middle[0] + wider * x, middle[1] + wider * y);
    }
    context.fill();
  }

  // The largest shear is as long as two gridlines.
  #drawShear(context, { shear_mpa: shear }, width, height) {
    const { xyz, screen } = this, count = shear.length / 2, lengths = Array.from({ length: count }, (_, at) => Math.hypot(shear[2 * at], shear[2 * at + 1])), most = Math.max(lengths.reduce((one, other) => Math.max(one, other), 0), 1e-6);
    const from = screen.slice(0, 3 * count), drawn = lengths.flatMap((length, at) => (length < MIN_SHEAR * most ? [] : [at]));
    for (const at of drawn) for (const axis of [0, 1]) xyz[3 * at + axis] += ((2 * this.edge_mm) / most) * shear[2 * at + axis];
    this.#project(count, width, height);
    context.strokeStyle = SHEAR_COLOR;
    context.lineWidth = 1.5;
    context.beginPath();
    for (const at of drawn) { context.moveTo(from[3 * at], from[3 * at + 1]); context.lineTo(screen[3 * at], screen[3 * at + 1]); }
    context.stroke();
  }

  #begin(pad) {
    const hex = (color) => [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16)), [[first, second]] = pad.cells;
    this.pad = pad;
    this.triangles = pad.cells.flatMap(([corner, ...ids], cell) => ids.slice(1).map((id, at) => ({ ids: [corner, ids[at], id], rgb: hex(pad.colors[cell]), depth: 0 })));
    this.row = new Int32Array(pad.xy_mm.length);
    this.xyz = new Float32Array(3 * pad.xy_mm.length);
    this.screen = new Float32Array(3 * pad.xy_mm.length);
    this.edge_mm = Math.hypot(...pad.xy_mm[first].map((value, axis) => value - pad.xy_mm[second][axis]));
    this.radius = Math.max(...pad.xy_mm.map(([x, y]) => Math.hypot(x, y)));
  }
}
