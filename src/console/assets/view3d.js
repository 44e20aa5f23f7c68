// A view in 3D that can be turned, with the pointer and the arrow keys.

import { Color, PerspectiveCamera, Scene, WebGLRenderer } from "./three/three.module.min.js";
import { OrbitControls } from "./three/OrbitControls.js";

export class View3d {
  /** Draws into a canvas that fills `view`, with a field of `degrees` from top to bottom and the direction `up`.
   * Throws if the browser has no WebGL. */
  constructor(view, canvas, degrees, up) {
    this.view = view;
    this.renderer = new WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.scene = new Scene();
    this.scene.background = new Color(0x101418);
    this.camera = new PerspectiveCamera(degrees, 1, 1, 1e5);
    this.camera.up.set(...up);
    this.controls = new OrbitControls(this.camera, view);
    this.controls.addEventListener("change", () => this.draw());
    this.controls.listenToKeyEvents(view);
    new ResizeObserver(() => this.resize()).observe(view);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.view;
    if (width && height) {
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.draw();
    }
  }

  draw() {
    this.renderer.render(this.scene, this.camera);
  }
}
