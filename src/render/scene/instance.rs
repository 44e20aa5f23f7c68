//! A moving mesh. Its bounding volume hierarchy is in the mesh's own frame, so rigid motion needs no
//! update of the hierarchy; after a deformation, its boxes are refitted.

use super::animation::Blend;
use super::hits::Surface;
use super::tree::{Elsewhere, Tree};
use crate::material::{Smoother, Spot};
use glam::{DVec3, Vec3};
use phasmid_geometry::Pose;
use phasmid_geometry::raycast::Bvh;
use std::sync::Arc;

/// The time-independent part of a moving mesh.
pub(crate) struct Model {
    /// Number of the mesh's first triangle among the world's surfaces.
    pub(crate) first: u32,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Rest positions of the vertices in the mesh's own frame, scaled.
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) rig_from_rest: Pose,
    /// Vertex positions at each keyframe of the deformation; empty if the mesh is rigid.
    pub(crate) keys: Vec<Vec<DVec3>>,
    /// Maximum distance of a vertex from the mesh's own origin over all keyframes, in millimetres.
    pub(crate) radius_mm: f64,
    /// For each keyframe, the maximum displacement of a vertex from its rest position, in
    /// millimetres.
    pub(crate) key_reach_mm: Vec<f64>,
    /// Computes smooth normals; `None` unless the mesh deforms and needs them.
    pub(crate) smoother: Option<Smoother>,
}

/// Shape of a mesh at an instant, in the mesh's own frame.
#[derive(Clone)]
struct Form {
    /// Keyframes and weights of the shape; `None` for the rest shape.
    blend: Option<Blend>,
    vertices: Vec<DVec3>,
    bvh: Bvh,
    normals: Vec<[Vec3; 3]>,
}

/// A moving mesh at an instant.
#[derive(Clone)]
pub(crate) struct Instance {
    model: Arc<Model>,
    form: Arc<Form>,
    frame: Elsewhere,
}

impl Instance {
    pub(crate) fn new(model: Model) -> Self {
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

    /// Sets the pose and keeps the shape.
    pub(crate) fn carry(&mut self, rig_from_instance: Pose) {
        self.frame = Elsewhere {
            rig_from_tree: rig_from_instance,
            tree_from_rig: rig_from_instance.inverse(),
        };
    }

    /// Returns the number of triangles if the mesh deforms, else 0.
    pub(crate) fn deforming_triangles(&self) -> usize {
        match self.model.keys.is_empty() {
            true => 0,
            false => self.model.triangles.len(),
        }
    }

    /// The time-independent part of a moving mesh.
    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the smooth normals at the corners of the mesh's triangles, in the mesh's own frame;
    /// empty if the normals at rest apply.
    pub(crate) fn smooth_normals(&self) -> &[[Vec3; 3]] {
        &self.form.normals
    }

    /// Returns the keyframes and weights of the present shape; `None` for the rest shape.
    pub(crate) fn blend(&self) -> Option<Blend> {
        self.form.blend
    }

    /// Blends keyframes into the present shape.
    pub(crate) fn deform(&mut self, blend: Blend) {
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

    /// Number of the mesh's first triangle among the world's surfaces.
    pub(crate) fn first(&self) -> u32 {
        self.model.first
    }

    /// Returns the mesh's hierarchy for ray casting.
    pub(crate) fn tree(&self) -> Tree<'_, Elsewhere> {
        Tree {
            bvh: &self.form.bvh,
            vertices: &self.form.vertices,
            triangles: &self.model.triangles,
            first: self.model.first,
            frame: self.frame,
        }
    }

    /// Returns whether a surface is a triangle of this mesh.
    pub(crate) fn holds(&self, surface: Surface) -> bool {
        let id = surface.0.wrapping_sub(self.model.first);
        (id as usize) < self.model.triangles.len()
    }

    /// Returns the current corners of a triangle of this mesh, in the rig's frame.
    pub(crate) fn corners(&self, surface: Surface) -> [DVec3; 3] {
        self.tree().corners(surface.0 - self.model.first)
    }

    /// Maps a spot on a triangle of this mesh to the rest shape.
    pub(crate) fn at_rest(&self, surface: Surface, spot: Spot) -> Spot {
        let (model, id) = (&self.model, (surface.0 - self.model.first) as usize);
        if model.keys.is_empty() {
            return spot.moved(&(model.rig_from_rest * self.frame.tree_from_rig));
        }
        let corner = |i: u32| model.rig_from_rest.point(model.vertices[i as usize]);
        spot.on(model.triangles[id].map(corner))
    }

    /// Returns the current smooth normals at the corners of one of the mesh's triangles, given the
    /// normals at rest.
    pub(crate) fn smooth(&self, surface: Surface, rest: [DVec3; 3]) -> [DVec3; 3] {
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
