//! The scene in the layout of `bvh.wgsl` and `world.wgsl`.
//!
//! Static and rigidly moving geometry is uploaded once; at each instant only poses are uploaded. For
//! a deforming mesh, its corners and boxes are uploaded too, about 4 MB for 65,536 triangles: the
//! CPU refits the mesh's hierarchy instead of rebuilding it. On two cores under other load, the
//! refit took at least 1.0 ms (fifteen runs), blending 0.1 ms and the normals in f64 1.1 ms; a
//! rebuild took at least 122 ms (four runs). The times are imprecise, but the difference is clear. A
//! refit by shaders has not been measured; the materials would still need the CPU's shape.

use super::Engine;
use crate::scene::{Blend, Frame, Placed, Tree, World, Worlds};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use phasmid_geometry::{Pose, Solid};
use rayon::prelude::*;

/// Two vectors that make up a node in the buffer `nodes` of `bvh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct NodeData {
    min: [f32; 3],
    first: u32,
    max: [f32; 3],
    count: u32,
}

/// Three vectors that make up a triangle in the buffer `triangles` of `bvh.wgsl`: each holds a
/// corner and a component of the normal.
type TriangleData = [[f32; 4]; 3];

/// Twin of `Tree` in `bvh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct TreeData {
    tree_from_rig: [[f32; 4]; 3],
    nodes: u32,
    triangles: u32,
    first: u32,
    count: u32,
    shape: u32,
    spare: [u32; 3],
}

/// Twin of `Solid` in `solid.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct SolidData {
    solid_from_rig: [[f32; 4]; 3],
    size: [f32; 4],
    kind: u32,
    object: u32,
    around_camera: u32,
    spare: u32,
}

/// Twin of `World` in `world.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct WorldData {
    trees: u32,
    solids: u32,
    triangles: u32,
    by_row: u32,
}

/// Offsets of the nodes and triangles of a hierarchy, one for each of its stored shapes.
struct Place {
    nodes: Vec<u32>,
    triangles: Vec<u32>,
    /// Shapes on the GPU; `None` for meshes that do not deform.
    blends: Vec<Option<Blend>>,
}

/// A scene on the GPU.
#[derive(Default)]
pub(crate) struct Scene {
    /// One entry for each hierarchy; the first is for the static geometry.
    places: Vec<Place>,
    /// Number of shapes kept for each deforming mesh; 0 before the first upload.
    shapes: usize,
}

/// Minimum size of a solid that the shaders treat as infinite.
const ENDLESS: f64 = 3e38;

fn rows(pose: &Pose) -> [[f32; 4]; 3] {
    std::array::from_fn(|i| {
        let row = pose.rotation.row(i).extend(pose.translation_mm[i]);
        row.as_vec4().to_array()
    })
}

impl SolidData {
    fn new(placed: &Placed) -> Self {
        let (kind, size) = match placed.solid {
            Solid::Plane { half } => (0, [half.x, half.y, 0.0, 0.0]),
            Solid::Sphere { radius } => (1, [radius, 0.0, 0.0, 0.0]),
            Solid::Cylinder {
                radius,
                half_length,
            } => (2, [radius, half_length, 0.0, 0.0]),
            Solid::Frustum { faces } => {
                let (side, offset) = faces[2];
                (3, [side.x, side.z, offset, faces[0].1])
            }
        };
        Self {
            solid_from_rig: rows(&placed.solid_from_rig),
            size: size.map(|s| s.min(ENDLESS) as f32),
            kind,
            object: placed.object.into(),
            around_camera: placed.around_camera.into(),
            spare: 0,
        }
    }
}

fn nodes<F>(tree: &Tree<'_, F>) -> Vec<NodeData> {
    let node = |n: &phasmid_geometry::raycast::Node| NodeData {
        min: n.min.to_array(),
        first: n.first,
        max: n.max.to_array(),
        count: n.count,
    };
    tree.bvh.nodes().iter().map(node).collect()
}

/// Returns the corners of triangles in the order of the hierarchy, and their unit normals. Normals
/// are computed in f64, so that small distant triangles have a normal too; the normal of a
/// degenerate triangle is zero.
fn triangles<F: Frame + Sync>(tree: &Tree<'_, F>) -> Vec<TriangleData> {
    tree.bvh
        .corners()
        .par_iter()
        .with_min_len(1024)
        .map(|leaf| {
            let [a, b, c] = tree.triangles[leaf.id as usize].map(|i| tree.vertices[i as usize]);
            let normal: DVec3 = (b - a).cross(c - a).normalize_or_zero();
            std::array::from_fn(|i| leaf.v[i].extend(normal[i] as f32).to_array())
        })
        .collect()
}

impl Scene {
    /// Uploads the scene in its current state; later calls upload only what has changed.
    pub(crate) fn update(&mut self, engine: &mut Engine, worlds: &Worlds, height: usize) {
        let steps = worlds.steps();
        if self.shapes == steps.len() {
            self.reshape(engine, steps);
        } else {
            self.begin(engine, steps);
        }
        self.place(engine, worlds, height);
    }

    /// Uploads everything except poses.
    fn begin(&mut self, engine: &mut Engine, steps: &[World]) {
        self.shapes = steps.len();
        self.places.clear();
        let mut all = Parts::default();
        let world = &steps[0];
        if let Some(still) = world.still() {
            self.places.push(all.add(&still, None));
        }
        for (i, instance) in world.instances.iter().enumerate() {
            let mut place = all.add(&instance.tree(), instance.blend());
            if instance.deforming_triangles() > 0 {
                for step in &steps[1..] {
                    let instance = &step.instances[i];
                    place.extend(all.add(&instance.tree(), instance.blend()));
                }
            }
            self.places.push(place);
        }
        let owner: Vec<u32> = world.owners().iter().map(|&o| o.into()).collect();
        engine.write("nodes", bytemuck::cast_slice(&all.nodes));
        engine.write("triangles", bytemuck::cast_slice(&all.triangles));
        engine.write("triangle_ids", bytemuck::cast_slice(&all.ids));
        engine.write("owner", bytemuck::cast_slice(&owner));
    }

    /// Uploads meshes that have deformed since the last call.
    fn reshape(&mut self, engine: &mut Engine, steps: &[World]) {
        let still = usize::from(steps[0].still().is_some());
        for (s, step) in steps.iter().enumerate() {
            for (instance, place) in step.instances.iter().zip(&mut self.places[still..]) {
                let now = instance.blend();
                if instance.deforming_triangles() == 0 || place.blends[s] == now {
                    continue;
                }
                place.blends[s] = now;
                let tree = instance.tree();
                let at = u64::from(place.nodes[s]) * size_of::<NodeData>() as u64;
                engine.write_at("nodes", at, bytemuck::cast_slice(&nodes(&tree)));
                let at = u64::from(place.triangles[s]) * size_of::<TriangleData>() as u64;
                engine.write_at("triangles", at, bytemuck::cast_slice(&triangles(&tree)));
            }
        }
    }

    /// Uploads all poses: one set for all rows, or one for each row.
    fn place(&self, engine: &mut Engine, worlds: &Worlds, height: usize) {
        let by_row = worlds.rows_together() == 1;
        let (mut trees, mut solids) = (Vec::new(), Vec::new());
        for row in 0..if by_row { height } else { 1 } {
            let world = worlds.at(row);
            let shape = worlds.step(row);
            let mut places = &self.places[..];
            if let (Some(still), [place, others @ ..]) = (world.still(), places) {
                trees.push(place.header(&still, &Pose::IDENTITY, shape));
                places = others;
            }
            for (instance, place) in world.instances.iter().zip(places) {
                let tree = instance.tree();
                trees.push(place.header(&tree, &tree.frame.tree_from_rig, shape));
            }
            solids.extend(world.solids.iter().map(SolidData::new));
        }
        // A binding must hold at least one element.
        trees.resize(trees.len().max(1), TreeData::zeroed());
        solids.resize(solids.len().max(1), SolidData::zeroed());
        let world = worlds.any();
        let data = WorldData {
            trees: self.places.len() as u32,
            solids: world.solids.len() as u32,
            triangles: world.triangle_count() as u32,
            by_row: by_row.into(),
        };
        engine.write("world", bytemuck::bytes_of(&data));
        engine.write("trees", bytemuck::cast_slice(&trees));
        engine.write("solids", bytemuck::cast_slice(&solids));
    }
}

/// Buffers that are being filled.
#[derive(Default)]
struct Parts {
    nodes: Vec<NodeData>,
    triangles: Vec<TriangleData>,
    ids: Vec<u32>,
}

impl Parts {
    fn add<F: Frame + Sync>(&mut self, tree: &Tree<'_, F>, blend: Option<Blend>) -> Place {
        let place = Place {
            nodes: vec![self.nodes.len() as u32],
            triangles: vec![self.triangles.len() as u32],
            blends: vec![blend],
        };
        self.nodes.extend(nodes(tree));
        self.triangles.extend(triangles(tree));
        self.ids
            .extend(tree.bvh.corners().iter().map(|leaf| leaf.id));
        place
    }
}

impl Place {
    fn extend(&mut self, other: Self) {
        self.nodes.extend(other.nodes);
        self.triangles.extend(other.triangles);
        self.blends.extend(other.blends);
    }

    fn header<F>(&self, tree: &Tree<'_, F>, tree_from_rig: &Pose, shape: usize) -> TreeData {
        let kept = shape.min(self.nodes.len() - 1);
        TreeData {
            tree_from_rig: rows(tree_from_rig),
            nodes: self.nodes[kept],
            triangles: self.triangles[kept],
            first: tree.first,
            count: tree.triangles.len() as u32,
            shape: shape as u32,
            spare: [0; 3],
        }
    }
}
