// A treatment room in 3D: the plan of a patient, where the patient is, and the pods. The room's z axis is up.

import {
  AmbientLight, AxesHelper, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide,
  Float32BufferAttribute, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, Points, PointsMaterial, Vector3,
} from "./three/three.module.min.js";
import { STEPS, quantise, texture } from "./colours.js";
import { View3d } from "./view3d.js";

/** Numbers of a point: its position and its distance from the plan. */
const STRIDE = 4;
const DISTANCE = { scale: "signed" };
/** Length of the isocentre's axes. */
const AXES_MM = 80;
/** Colours of pods, by M. Okabe and K. Ito. */
export const POD_COLOURS = ["#e69f00", "#56b4e9", "#009e73", "#cc79a7", "#0072b2", "#d55e00", "#f0e442"];

/** Sets the numbers of an attribute, in the buffer that it has if they are as many. */
function set(geometry, name, numbers, size, normalized = false) {
  const known = geometry.getAttribute(name);
  if (known?.array.length === numbers.length) {
    known.array.set(numbers);
    known.needsUpdate = true;
    return;
  }
  // Frees the buffers.
  geometry.dispose();
  geometry.setAttribute(name, new BufferAttribute(numbers, size, normalized));
}

const surface = (color, opacity) => new Mesh(new BufferGeometry(), new MeshLambertMaterial({
  color, opacity, transparent: opacity < 1, depthWrite: opacity === 1, side: DoubleSide, flatShading: true,
}));

export class RoomScene extends View3d {
  /** Draws into a canvas that fills `view`. Throws if the browser has no WebGL. */
  constructor(view, canvas) {
    super(view, canvas, 35, [0, 0, 1]);
    const light = new DirectionalLight(0xffffff, 2);
    light.position.set(-1, -2, 3);
    this.planned = { skin: surface(0x9aa4ad, 0.35), tumour: surface(0xe69f00, 0.45) };
    this.tracked = { skin: surface(0x3f9ad0, 1), tumour: surface(0xff4fa3, 1) };
    // The tumour is inside the patient, and is to be seen there.
    for (const { tumour } of [this.planned, this.tracked]) {
      [tumour.material.depthTest, tumour.renderOrder] = [false, 1];
    }
    this.points = new Points(new BufferGeometry(), new PointsMaterial({ size: 3, sizeAttenuation: false, vertexColors: true }));
    this.pods = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));
    this.scene.add(
      new AmbientLight(0xffffff, 0.8), light, new AxesHelper(AXES_MM), this.planned.skin, this.tracked.skin, this.points, this.pods,
      this.planned.tumour, this.tracked.tumour,
    );
    for (const part of [this.planned, this.tracked].flatMap(Object.values).concat(this.points, this.pods)) {
      part.frustumCulled = false;
    }
    this.resize();
  }

  /** Shows the plan: vertices and triangles of the skin, then of the tumour. */
  plan(surfaces, fields) {
    ["skin", "tumour"].forEach((name, i) => {
      const [vertices, triangles] = surfaces[i];
      for (const part of [this.planned[name], this.tracked[name]]) {
        part.geometry.dispose();
        part.geometry = new BufferGeometry();
        part.geometry.setIndex(new BufferAttribute(triangles, 1));
      }
      this.planned[name].geometry.setAttribute("position", new BufferAttribute(vertices, 3));
    });
    this.tracked.skin.visible = false;
    this.tracked.tumour.visible = false;
    this.showPods(fields);
    if (!this.placed) {
      this.fit();
    }
    this.draw();
  }

  showPods(fields) {
    const [positions, colours] = [[], []];
    fields.forEach(({ apex, corners }, pod) => {
      // As far as the isocentre's height.
      const far = Math.hypot(...apex);
      const tips = corners.map((corner) => {
        const length = Math.hypot(...corner);
        return corner.map((part, i) => apex[i] + (part * far) / length);
      });
      const { r, g, b } = new Color(POD_COLOURS[pod % POD_COLOURS.length]);
      tips.forEach((tip, i) => {
        positions.push(...apex, ...tip, ...tip, ...tips[(i + 1) % tips.length]);
        colours.push(...Array(4).fill([r, g, b]).flat());
      });
    });
    this.pods.geometry.dispose();
    this.pods.geometry = new BufferGeometry();
    this.pods.geometry.setAttribute("position", new Float32BufferAttribute(positions, 3));
    this.pods.geometry.setAttribute("color", new Float32BufferAttribute(colours, 3));
  }

  /** Shows the patient of a scan; points are coloured by their distance from the plan, up to `most` millimetres. */
  track({ points, skin, tumour, most, shown }) {
    for (const [name, vertices] of Object.entries({ skin, tumour })) {
      const part = this.tracked[name];
      part.visible = shown.tracked && vertices.length > 0;
      if (vertices.length) {
        set(part.geometry, "position", vertices, 3);
      }
      this.planned[name].visible = shown.planned;
    }
    const count = points.length / STRIDE;
    const [positions, distances] = [new Float32Array(3 * count), new Float32Array(count)];
    for (let i = 0; i < count; i++) {
      positions.set(points.subarray(STRIDE * i, STRIDE * i + 3), 3 * i);
      distances[i] = points[STRIDE * i + 3];
    }
    const [steps, table, colours] = [new Uint16Array(count), texture(DISTANCE), new Uint8Array(3 * count)];
    quantise(DISTANCE, distances, [-most, most], steps);
    steps.forEach((step, i) => colours.set(step < STEPS ? table.subarray(4 * step, 4 * step + 3) : [90, 90, 90], 3 * i));
    set(this.points.geometry, "position", positions, 3);
    set(this.points.geometry, "color", colours, 3, true);
    this.points.visible = shown.points;
    this.pods.visible = shown.pods;
    this.draw();
  }

  /** Looks at the isocentre from above the foot end. */
  fit() {
    const { geometry } = this.planned.skin;
    geometry.computeBoundingSphere();
    const radius = geometry.boundingSphere?.radius || 500;
    this.controls.target.set(0, 0, 0);
    this.camera.position.copy(new Vector3(-0.6, -1, 0.9).normalize().multiplyScalar(2.8 * radius));
    this.placed = true;
    this.controls.update();
    this.draw();
  }
}
