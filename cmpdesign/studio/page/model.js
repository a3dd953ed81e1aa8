// Parts in 3-D: turned with the pointer, taken apart, cut by a plane, shown one by one.

import { h } from "./base.js";
import * as three from "./three.js";

export class Model {
  constructor(glb, title) {
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera(35, 1, 0.0005, 10);
    this.renderer = new three.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.localClippingEnabled = true;
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute("aria-label", `${title}; drag turns it, wheel zooms`);
    this.canvas.setAttribute("role", "img");
    const light = new three.DirectionalLight(0xffffff, 2.2);
    light.position.set(1, 2, 1.5);
    this.scene.add(new three.HemisphereLight(0xffffff, 0x8890a0, 1.6), light);
    this.controls = new three.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.plane = new three.Plane(new three.Vector3(0, 0, -1), 0);
    this.list = h("div", { class: "parts", role: "group", "aria-label": "Parts" });
    this.elements = [h("div", { class: "canvas3d" }, this.canvas), this.list];
    this.resize = new ResizeObserver(() => this.draw());
    this.resize.observe(this.canvas.parentElement);
    new three.GLTFLoader().parse(glb, "", (found) => this.#take(found.scene), (error) => this.list.replaceChildren(String(error.message ?? error)));
  }

  #take(group) {
    this.parts = [...group.children];
    this.scene.add(group);
    const box = new three.Box3().setFromObject(group), size = box.getSize(new three.Vector3()), middle = box.getCenter(new three.Vector3());
    const radius = size.length() / 2;
    this.camera.near = radius / 100;
    this.camera.far = radius * 100;
    this.camera.position.copy(middle).add(new three.Vector3(0.7, 0.8, 1));
    this.controls.target.copy(middle);
    this.#fit(group);
    const heights = this.parts.map((part) => new three.Box3().setFromObject(part).getCenter(new three.Vector3()).y);
    const order = [...heights.keys()].sort((one, other) => heights[one] - heights[other]);
    for (const { material } of this.parts) {
      material.clippingPlanes = [this.plane];
      // Faces of a clear part that touch another part are not seen, and what is behind them is.
      if (material.transparent) material.depthWrite = false; else material.side = three.DoubleSide;
    }
    const slider = (name, value, act) => h("label", {}, name, h("input", { type: "range", min: 0, max: 1, step: 0.01, value, oninput: (event) => { act(Number(event.target.value)); this.draw(); } }));
    const explode = (share) => { order.forEach((part, rank) => { this.parts[part].position.y = share * rank * Math.max(size.y, radius / 6) * 0.6; }); this.#fit(group); };
    const cut = (share) => { this.plane.constant = box.min.z + (1 - share) * (box.max.z - box.min.z) * 1.001; };
    cut(0);
    this.list.replaceChildren(slider("Apart", 0, explode), slider("Cut", 0, cut), ...this.parts.map((part) =>
      h("label", {}, h("input", { type: "checkbox", ".checked": true, onchange: (event) => { part.visible = event.target.checked; this.draw(); } }), part.name)));
    this.draw();
  }

  // All parts are in view, from the present direction.
  #fit(group) {
    const box = new three.Box3().setFromObject(group), middle = box.getCenter(new three.Vector3()), radius = box.getSize(new three.Vector3()).length() / 2;
    const direction = this.camera.position.clone().sub(this.controls.target).setLength(radius * 3.1);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).add(direction);
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.camera.lookAt(this.controls.target);
    this.renderer.render(this.scene, this.camera);
  }

  dispose() { this.resize.disconnect(); this.controls.dispose(); this.renderer.dispose(); }
}
