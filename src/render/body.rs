//! A mesh that moves: its hierarchy stands in its own frame, so that a rigid motion costs nothing,
//! and its boxes follow where it deforms.

use super::look::{Smoother, Spot};
use super::path::Blend;
use super::tree::{Elsewhere, Tree};
use super::world::Surface;
use glam::{DVec3, Vec3};
use phasmid_geometry::Pose;
use phasmid_geometry::raycast::Bvh;
use std::sync::Arc;

/// What no motion changes.
pub(super) struct Model {
    /// Number of its first triangle among the world's surfaces.
    pub(super) first: u32,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Where its vertices rest in its own frame, scaled.
    pub(super) vertices: Vec<DVec3>,
    pub(super) rig_from_rest: Pose,
    /// The same vertices at each keyframe of its deformation; empty where it is stiff.
    pub(super) keys: Vec<Vec<DVec3>>,
    /// The farthest that any shape has a vertex from the mesh's own origin, in millimetres,
    pub(super) radius_mm: f64,
    /// and the farthest that each keyframe takes a vertex from where it rests.
    pub(super) key_reach_mm: Vec<f64>,
    /// Makes its smooth normals, where something needs them and it deforms.
    pub(super) smoother: Option<Smoother>,
}

/// Its shape at an instant, in its own frame.
#[derive(Clone)]
struct Form {
    /// The keyframes that it is made of; `None` where it rests.
    blend: Option<Blend>,
    vertices: Vec<DVec3>,
    bvh: Bvh,
    normals: Vec<[Vec3; 3]>,
}

/// A mesh that moves, where it is at an instant.
#[derive(Clone)]
pub(super) struct Body {
    model: Arc<Model>,
    form: Arc<Form>,
    frame: Elsewhere,
}

impl Body {
    pub(super) fn new(model: Model) -> Self {
        let bvh = Bvh::build(&model.vertices, &model.triangles);
        let deforms = !model.keys.is_empty();
        Self {
            form: Arc::new(Form {
                blend: None,
                vertices: model.vertices.clone(),
                bvh: if deforms { bvh.ordered() } else { bvh },
                normals: Vec::new(),
            }),
            frame: Elsewhere {
                rig_from_tree: model.rig_from_rest,
                tree_from_rig: model.rig_from_rest.inverse(),
            },
            model: Arc::new(model),
        }
    }

    /// Takes it to another place as it is.
    pub(super) fn carry(&mut self, rig_from_body: Pose) {
        self.frame = Elsewhere {
            rig_from_tree: rig_from_body,
            tree_from_rig: rig_from_body.inverse(),
        };
    }

    /// Triangles of a mesh that deforms.
    pub(super) fn deforming_triangles(&self) -> usize {
        match self.model.keys.is_empty() {
            true => 0,
            false => self.model.triangles.len(),
        }
    }

    /// What no motion changes.
    pub(super) fn model(&self) -> &Model {
        &self.model
    }

    /// Smooth normals of its triangles' corners in its own frame; empty where those at rest count.
    pub(super) fn smooth_normals(&self) -> &[[Vec3; 3]] {
        &self.form.normals
    }

    /// The keyframes that its shape is made of; `None` where it rests.
    pub(super) fn blend(&self) -> Option<Blend> {
        self.form.blend
    }

    /// Gives it another shape.
    pub(super) fn deform(&mut self, blend: Blend) {
        let (keys, weights) = blend;
        let model = &self.model;
        let form = Arc::make_mut(&mut self.form);
        form.blend = Some(blend);
        let meshes = keys.map(|key| &model.keys[key]);
        for (i, vertex) in form.vertices.iter_mut().enumerate() {
            *vertex = (0..4).map(|k| meshes[k][i] * weights[k]).sum();
        }
        form.bvh.refit(&form.vertices, &model.triangles);
        if let Some(smoother) = &model.smoother {
            form.normals = smoother.normals(&form.vertices, &model.triangles);
        }
    }

    /// Number of its first triangle among the world's surfaces.
    pub(super) fn first(&self) -> u32 {
        self.model.first
    }

    /// What rays can meet.
    pub(super) fn tree(&self) -> Tree<'_, Elsewhere> {
        Tree {
            bvh: &self.form.bvh,
            vertices: &self.form.vertices,
            triangles: &self.model.triangles,
            first: self.model.first,
            frame: self.frame,
        }
    }

    /// Whether a surface is one of its triangles.
    pub(super) fn holds(&self, surface: Surface) -> bool {
        let id = surface.0.wrapping_sub(self.model.first);
        (id as usize) < self.model.triangles.len()
    }

    /// The corners of one of its triangles now, in the rig's frame.
    pub(super) fn corners(&self, surface: Surface) -> [DVec3; 3] {
        self.tree().corners(surface.0 - self.model.first)
    }

    /// A spot on one of its triangles where it rests.
    pub(super) fn at_rest(&self, surface: Surface, spot: Spot) -> Spot {
        let (model, id) = (&self.model, (surface.0 - self.model.first) as usize);
        if model.keys.is_empty() {
            return spot.moved(&(model.rig_from_rest * self.frame.tree_from_rig));
        }
        let corner = |i: u32| model.rig_from_rest.point(model.vertices[i as usize]);
        spot.on(model.triangles[id].map(corner))
    }

    /// The smooth normals at the corners of one of its triangles now, of those that it has at rest.
    pub(super) fn smooth(&self, surface: Surface, rest: [DVec3; 3]) -> [DVec3; 3] {
        let id = (surface.0 - self.model.first) as usize;
        match self.form.normals.get(id) {
            Some(normals) => normals.map(|n| self.frame.rig_from_tree.direction(n.as_dvec3())),
            None => {
                let turn = self.frame.rig_from_tree * self.model.rig_from_rest.inverse();
                rest.map(|n| turn.direction(n))
            }
        }
    }
}
