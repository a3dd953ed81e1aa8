// The surface of several views in 3-D: the pad's cells at the places of their markers; red where it is pressed.

import * as three from "./three.js";

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

  // Markers move from their place at rest by their displacement, enlarged.
  show(pad, frame, factor, width, height) {
    if (this.pad !== pad) this.#begin(pad);
    const row = new Map(frame.ids.map((id, at) => [id, at])), pressure = frame.contact?.pressure_mpa, most = Math.max(...(pressure ?? []), 1e-3);
    const points = [], colors = [], color = new three.Color(), pressed = new three.Color("#ff2020");
    pad.cells.forEach((corners, cell) => {
      const rows = corners.map((id) => row.get(id));
      if (rows.includes(undefined)) return;
      rows.forEach((at) => {
        const [x, y, z] = frame.place[at], [dx, dy, dz] = frame.moved[at];
        points.push(x + (factor - 1) * dx, y + (factor - 1) * dy, z + (factor - 1) * dz);
        color.set(pad.colors[cell]);
        if (pressure) color.lerp(pressed, Math.max(0, pressure[at] / most) * 0.85);
        colors.push(color.r, color.g, color.b);
      });
    });
    const geometry = this.mesh.geometry;
    geometry.setAttribute("position", new three.BufferAttribute(new Float32Array(points), 3));
    geometry.setAttribute("color", new three.BufferAttribute(new Float32Array(colors), 3));
    geometry.computeVertexNormals();
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  #begin(pad) {
    this.pad = pad;
    if (this.mesh) this.scene.remove(this.mesh);
    this.mesh = new three.Mesh(new three.BufferGeometry(), new three.MeshStandardMaterial({ vertexColors: true, side: three.DoubleSide, roughness: 0.7, flatShading: true }));
    this.mesh.frustumCulled = false;
    this.scene.add(this.mesh);
    const radius = Math.max(...pad.xy_mm.map(([x, y]) => Math.hypot(x, y)));
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0, -2.6 * radius, 2.6 * radius);
    this.controls.target.set(0, 0, 0);
  }
}
