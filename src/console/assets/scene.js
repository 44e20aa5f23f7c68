// The objects of an emulated scene in 3D, and handles that move one.

import {
  AxesHelper, CylinderGeometry, Group, LineBasicMaterial, LineSegments, MathUtils, Matrix4, PlaneGeometry, SphereGeometry,
  WireframeGeometry,
} from "./three/three.module.min.js";
import { TransformControls } from "./three/TransformControls.js";

const OUTLINE = new LineBasicMaterial({ color: 0x7f8c99, transparent: true, opacity: 0.5 });
/** Side of the part of an infinite plane that is drawn, and length of an object's axes. */
const [PLANE_MM, AXES_MM] = [1000, 60];
/** The scene's angles turn about its fixed x, then y, then z axis. */
const ORDER = "ZYX";

/** Returns the outline of a shape in its own frame; nothing for one that is not simple. */
function outline(shape) {
  const geometry = {
    plane: ({ size_mm: size }) => new PlaneGeometry(...(size ?? [PLANE_MM, PLANE_MM]), 10, 10),
    sphere: ({ radius_mm: radius }) => new SphereGeometry(radius, 24, 16),
    cylinder: ({ radius_mm: radius, length_mm: length }) => new CylinderGeometry(radius, radius, length, 24, 1),
    frustum: ({ base_mm: base, top_mm: top, height_mm: height }) =>
      new CylinderGeometry(top * Math.SQRT1_2, base * Math.SQRT1_2, height, 4, 1)
        .rotateY(Math.PI / 4).rotateX(-Math.PI / 2).translate(0, 0, -height / 2),
  }[shape.kind]?.(shape);
  return geometry && new LineSegments(new WireframeGeometry(geometry), OUTLINE);
}

function setPose(node, { position_mm: position, rotation_deg: rotation }) {
  node.position.set(...position);
  node.rotation.set(...rotation.map(MathUtils.degToRad), ORDER);
}

export class SceneModel {
  /** `moved` is called with an object's number and its new pose. */
  constructor(cloud, moved) {
    this.cloud = cloud;
    this.moved = moved;
    this.root = new Group();
    this.root.matrixAutoUpdate = false;
    this.root.visible = false;
    this.handles = new TransformControls(cloud.camera, cloud.view);
    this.handles.addEventListener("change", () => this.quiet || cloud.draw());
    this.handles.addEventListener("dragging-changed", ({ value: dragging }) => {
      cloud.controls.enabled = !dragging;
      if (!dragging) {
        this.drop();
      }
    });
    cloud.scene.add(this.root, this.handles.getHelper());
    this.nodes = [];
  }

  /** Shows objects as the device tells them, and a handle at the chosen one; nothing without objects. Returns
   * whether that has to be drawn. */
  show(shown) {
    const wasVisible = this.root.visible;
    // A change of the handles is drawn with the rest.
    this.quiet = true;
    this.place(shown);
    this.quiet = false;
    return wasVisible || this.root.visible;
  }

  place({ scene, fields, chosen, mode }) {
    const { root, handles } = this;
    root.visible = scene !== null;
    const enabled = root.visible && chosen !== null;
    if (!enabled && handles.dragging) {
      // Control was lost meanwhile.
      handles.dragging = false;
    }
    handles.enabled = enabled;
    if (!root.visible) {
      handles.detach();
      return;
    }
    const rig = new Group();
    setPose(rig, scene.rig);
    rig.updateMatrix();
    root.matrix.copy(new Matrix4().copy(rig.matrix).invert());
    const shapes = scene.objects.map((_, i) => JSON.stringify(fields?.object[i] ?? null));
    if (String(shapes) !== String(this.shapes)) {
      this.shapes = shapes;
      this.build(scene.objects.map((_, i) => fields?.object[i]));
    }
    scene.objects.forEach((object, i) => {
      // The object that is being moved is where the pointer is.
      if (!(handles.dragging && handles.object === this.nodes[i])) {
        setPose(this.nodes[i], object);
      }
    });
    const node = chosen === null ? undefined : this.nodes[chosen];
    if (!node) {
      handles.detach();
    } else if (handles.object !== node) {
      handles.attach(node);
    }
    handles.setMode(mode);
  }

  build(objects) {
    this.handles.detach();
    this.root.clear();
    this.nodes = objects.map((object) => {
      const node = new Group();
      const shown = object && outline(object.shape);
      if (shown) {
        shown.scale.setScalar(object.scale);
        node.add(shown);
      }
      node.add(new AxesHelper(AXES_MM).setColors(0xb0b0b0, 0xb0b0b0, 0xb0b0b0));
      this.root.add(node);
      return node;
    });
  }

  drop() {
    const object = this.nodes.indexOf(this.handles.object);
    if (object >= 0) {
      const { position, rotation } = this.nodes[object];
      this.moved({
        object,
        position_mm: position.toArray(),
        rotation_deg: rotation.toArray().slice(0, 3).map(MathUtils.radToDeg),
      });
    }
  }
}
