// The point cloud in 3D, with the fields of view of camera and projector.

import {
  BufferGeometry, Color, DataTexture, Float32BufferAttribute, GLSL3, InterleavedBuffer, InterleavedBufferAttribute,
  LineBasicMaterial, LineSegments, Points, ShaderMaterial, Vector3,
} from "./three/three.module.min.js";
import { STEPS, texture } from "./colours.js";
import { View3d } from "./view3d.js";

/** Numbers of a point: its position and its value. */
const STRIDE = 4;
const FIELD_COLOURS = { camera: 0x3f9ad0, projector: 0xe69f00 };
/** Maximum number of points that the extent is found by. */
const SAMPLES = 20_000;
// The colour is found once for each point, not for each of its pixels: without a GPU that halves the time.
const VERTEX = `
in float value;
uniform float low, high, spread, pixels;
uniform sampler2D colours;
flat out vec3 colour;
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * seen;
  // Somewhat larger than the pixel of the camera that saw the point, so that surfaces are closed.
  gl_PointSize = clamp(1.3 * pixels * spread * position.z / max(-seen.z, 1e-6), 1.0, 12.0);
  int last = textureSize(colours, 0).x - 1;
  int step = int(clamp((value - low) / (high - low), 0.0, 1.0) * float(last) + 0.5);
  colour = isnan(value) ? vec3(0.45) : texelFetch(colours, ivec2(step, 0), 0).rgb;
}`;
const FRAGMENT = `
precision mediump float;
flat in vec3 colour;
out vec4 drawn;
void main() {
  drawn = vec4(colour, 1.0);
}`;

export class Cloud extends View3d {
  /** Draws into a canvas that fills `view`. Throws if the browser has no WebGL. */
  constructor(view, canvas) {
    // The rig's frame has y down and z forward.
    super(view, canvas, 40, [0, -1, 0]);
    this.material = new ShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: { low: { value: 0 }, high: { value: 1 }, spread: { value: 0 }, pixels: { value: 1 }, colours: { value: null } },
    });
    this.points = new Points(new BufferGeometry(), this.material);
    this.points.frustumCulled = false;
    this.fields = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));
    this.fields.frustumCulled = false;
    this.scene.add(this.points, this.fields);
    this.placed = false;
    this.resize();
  }

  resize() {
    // How many pixels a point has depends on the height.
    const { pixels } = this.material.uniforms;
    pixels.value = this.view.clientHeight / (2 * Math.tan((this.camera.fov * Math.PI) / 360));
    super.resize();
  }

  /** Shows points: four numbers each. `every` says how many pixels they are apart in the camera. */
  show({ about, values, every, layer, range: [low, high], fields }) {
    const { uniforms } = this.material;
    const buffer = new InterleavedBuffer(values, STRIDE);
    this.points.geometry.dispose();
    this.points.geometry = new BufferGeometry();
    this.points.geometry.setAttribute("position", new InterleavedBufferAttribute(buffer, 3, 0));
    this.points.geometry.setAttribute("value", new InterleavedBufferAttribute(buffer, 1, 3));
    if (this.scale !== layer.scale) {
      this.scale = layer.scale;
      uniforms.colours.value?.dispose();
      uniforms.colours.value = new DataTexture(texture(layer), STEPS, 1);
      uniforms.colours.value.needsUpdate = true;
    }
    [uniforms.low.value, uniforms.high.value] = [low, high];
    const camera = about.fields.find((field) => field.name === "camera") ?? about.fields[0];
    const [left, right] = camera.corners;
    uniforms.spread.value = (every * Math.hypot(...right.map((x, i) => x - left[i]))) / about.width;
    this.showFields(fields ? about.fields : [], values);
    if (!this.placed && values.length) {
      this.place(values, camera);
    }
    this.draw();
  }

  showFields(fields, values) {
    const far = extent(values).far;
    const [positions, colours] = [[], []];
    for (const { name, apex, corners } of fields) {
      const tips = corners.map((corner) => corner.map((part, i) => apex[i] + part * far));
      const { r, g, b } = new Color(FIELD_COLOURS[name] ?? 0xffffff);
      tips.forEach((tip, i) => {
        positions.push(...apex, ...tip, ...tip, ...tips[(i + 1) % tips.length]);
        for (let end = 0; end < 4; end++) {
          colours.push(r, g, b);
        }
      });
    }
    this.fields.geometry.dispose();
    this.fields.geometry = new BufferGeometry();
    this.fields.geometry.setAttribute("position", new Float32BufferAttribute(positions, 3));
    this.fields.geometry.setAttribute("color", new Float32BufferAttribute(colours, 3));
  }

  /** Looks at the points from beside the camera. */
  place(values, field) {
    const { middle, size, far } = extent(values);
    const apex = new Vector3(...field.apex);
    const away = apex.clone().sub(middle).normalize();
    const side = new Vector3(0.35, -0.25, 0);
    this.controls.target.copy(middle);
    this.camera.near = Math.max(far, size) / 1000;
    this.camera.far = 20 * Math.max(far, size);
    this.camera.position.copy(middle).add(away.add(side).normalize().multiplyScalar(1.6 * size));
    this.camera.updateProjectionMatrix();
    this.placed = true;
    this.controls.update();
  }

  /** Looks at the points from where it began, when they are shown next. */
  reset() {
    this.placed = false;
  }
}

/** Returns the middle, the size, and the largest depth of the points. */
function extent(values) {
  const count = values.length / STRIDE;
  const step = STRIDE * Math.max(1, Math.floor(count / SAMPLES));
  const axes = [[], [], []];
  for (let i = 0; i < values.length; i += step) {
    axes.forEach((axis, k) => axis.push(values[i + k]));
  }
  axes.forEach((axis) => axis.sort((a, b) => a - b));
  const at = (axis, part) => axis[Math.round(part * (axis.length - 1))] ?? 0;
  const [low, high] = [0.02, 0.98].map((part) => axes.map((axis) => at(axis, part)));
  const middle = new Vector3(...low.map((x, i) => (x + high[i]) / 2));
  return { middle, size: Math.hypot(...low.map((x, i) => high[i] - x)) || 1, far: at(axes[2], 0.98) || 1 };
}
