// The surface of several views in 3-D: the pad's cells at the places of their markers; red where it is pressed.

import * as three from "./three.js";

const PRESSED = new three.Color("#ff2020").toArray();

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
    position.needsUpdate = color.needsUpdate = true;
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  #begin(pad) {
    this.pad = pad;
    if (this.mesh) { this.scene.remove(this.mesh); this.mesh.geometry.dispose(); }
    this.triangles = pad.cells.flatMap(([first, ...ids], cell) => ids.slice(1).map((id, at) => [[first, ids[at], id], new three.Color(pad.colors[cell]).toArray()]));
    const geometry = new three.BufferGeometry();
    for (const name of ["position", "color"]) geometry.setAttribute(name, new three.BufferAttribute(new Float32Array(9 * this.triangles.length), 3));
    this.row = new Int32Array(pad.xy_mm.length);
    this.mesh = new three.Mesh(geometry, new three.MeshStandardMaterial({ vertexColors: true, side: three.DoubleSide, roughness: 0.7, flatShading: true }));
    this.mesh.frustumCulled = false;
    this.scene.add(this.mesh);
    const radius = Math.max(...pad.xy_mm.map(([x, y]) => Math.hypot(x, y)));
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0, -2.6 * radius, 2.6 * radius);
    this.controls.target.set(0, 0, 0);
  }
}
