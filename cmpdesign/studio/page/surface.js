// The surface of several views in 3-D: the pad's cells at the places of their markers; red where it is pressed, with a
// line along the shear.

import * as three from "./three.js";

const PRESSED = new three.Color("#ff2020").toArray(), SHEAR_COLOR = "#ffe94a", MIN_SHEAR = 0.04; // of the largest

export class Surface {
  constructor() {
    this.renderer = new three.WebGLRenderer({ antialias: true, alpha: true });
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "The surface; drag turns it, wheel zooms");
    this.scene = new three.Scene();
    const light = new three.DirectionalLight(0xffffff, 2.5);
    light.position.set(-1, 1, 2);
    this.scene.add(new three.HemisphereLight(0xffffff, 0x8890a0, 1.4), light);
    this.camera = new three.PerspectiveCamera(35, 1, 0.1, 2000);
    this.controls = new three.OrbitControls(this.camera, this.canvas);
  }

  // Markers move from their place at rest by their displacement, enlarged. Cells of lost markers are left out.
  show(pad, frame, factor, width, height) {
    if (this.pad !== pad) this.#begin(pad);
    const { position, color } = this.mesh.geometry.attributes, { row } = this;
    row.fill(-1);
    frame.ids.forEach((id, at) => { row[id] = at; });
    const pressure = frame.contact?.pressure_mpa, most = Math.max(...(pressure ?? []), 1e-3);
    let corner = 0;
    this.triangles.forEach(([ids, rgb]) => {
      if (ids.some((id) => row[id] < 0)) return;
      for (const id of ids) {
        const at = row[id], place = frame.place[at], moved = frame.moved[at], share = pressure ? Math.max(0, pressure[at] / most) * 0.85 : 0;
        for (let axis = 0; axis < 3; axis += 1) {
          position.array[3 * corner + axis] = place[axis] + (factor - 1) * moved[axis];
          color.array[3 * corner + axis] = rgb[axis] + share * (PRESSED[axis] - rgb[axis]);
        }
        corner += 1;
      }
    });
    this.mesh.geometry.setDrawRange(0, corner);
    this.#drawShear(frame, factor);
    position.needsUpdate = color.needsUpdate = true;
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  // The largest shear is as long as two gridlines.
  #drawShear({ place, moved, contact }, factor) {
    const { position } = this.shear.geometry.attributes, shear = contact?.shear_mpa ?? [], lengths = shear.map((by) => Math.hypot(...by)), most = Math.max(...lengths, 1e-6);
    let end = 0;
    shear.forEach((by, at) => {
      if (lengths[at] < MIN_SHEAR * most) return;
      for (const share of [0, (2 * this.edge_mm) / most]) {
        place[at].forEach((value, axis) => { position.array[3 * end + axis] = value + (factor - 1) * moved[at][axis] + share * (by[axis] ?? 0); });
        end += 1;
      }
    });
    this.shear.geometry.setDrawRange(0, end);
    position.needsUpdate = true;
  }

  #begin(pad) {
    this.pad = pad;
    for (const old of [this.mesh, this.shear]) if (old) { this.scene.remove(old); old.geometry.dispose(); }
    this.triangles = pad.cells.flatMap(([first, ...ids], cell) => ids.slice(1).map((id, at) => [[first, ids[at], id], new three.Color(pad.colors[cell]).toArray()]));
    const geometry = new three.BufferGeometry();
    for (const name of ["position", "color"]) geometry.setAttribute(name, new three.BufferAttribute(new Float32Array(9 * this.triangles.length), 3));
    this.row = new Int32Array(pad.xy_mm.length);
    this.mesh = new three.Mesh(geometry, new three.MeshStandardMaterial({ vertexColors: true, side: three.DoubleSide, roughness: 0.7, flatShading: true }));
    this.mesh.frustumCulled = false;
    const lines = new three.BufferGeometry(), [[first, second]] = pad.cells;
    lines.setAttribute("position", new three.BufferAttribute(new Float32Array(6 * pad.xy_mm.length), 3));
    this.shear = new three.LineSegments(lines, new three.LineBasicMaterial({ color: SHEAR_COLOR, depthTest: false }));
    this.shear.frustumCulled = false;
    this.edge_mm = Math.hypot(...pad.xy_mm[first].map((value, axis) => value - pad.xy_mm[second][axis]));
    this.scene.add(this.mesh, this.shear);
    const radius = Math.max(...pad.xy_mm.map(([x, y]) => Math.hypot(x, y)));
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0, -2.6 * radius, 2.6 * radius);
    this.controls.target.set(0, 0, 0);
  }
}
