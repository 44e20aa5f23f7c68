//! The ways of what moves, and where all of it is at an instant.

use crate::error::{Error, Result};
use crate::geometry::{Mesh, Pose, Timeline, Trajectory};
use crate::profile::{Motion, Object, Scene};
use glam::DVec3;

/// Most vertices of all meshes of a deformation together: 1.2 GB.
const MAX_KEY_VERTICES: usize = 50_000_000;

/// An object that moves.
pub(super) struct Path {
    pub(super) object: u16,
    pub(super) part: Part,
    pub(super) rig_from_rest: Pose,
    trajectory: Option<Trajectory>,
    deformation: Option<Timeline>,
}

/// Which of the world's parts it is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Part {
    Solid(usize),
    Body(usize),
}

/// Where an object is at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    pub(super) rig_from_object: Pose,
    pub(super) blend: Option<Blend>,
}

/// The keyframes that make a shape, and their weights.
pub(super) type Blend = ([usize; 4], [f64; 4]);

/// Where everything that moves is at an instant.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State(pub(super) Vec<Placement>);

/// Whether an object ever leaves its place or its shape.
pub(super) fn moves(object: &Object) -> bool {
    object.motion.as_ref().is_some_and(Motion::goes_anywhere) || object.deform.is_some()
}

impl Path {
    pub(super) fn new(scene: &Scene, object: &Object, index: u16, part: Part) -> Self {
        Self {
            object: index,
            part,
            rig_from_rest: scene.rig_from_object(object),
            trajectory: object.motion.as_ref().map(|m| m.trajectory()),
            deformation: object.deform.as_ref().map(|d| d.timeline()),
        }
    }

    /// How far its keyframes are from where it rests, in millimetres.
    pub(super) fn reach_mm(&self) -> f64 {
        self.trajectory.as_ref().map_or(0.0, Trajectory::reach_mm)
    }

    /// Where the object is at a device time in nanoseconds.
    pub(super) fn at(&self, time_ns: f64) -> Placement {
        let time_s = time_ns * 1e-9;
        Placement {
            rig_from_object: match &self.trajectory {
                Some(trajectory) => self.rig_from_rest * trajectory.pose(time_s),
                None => self.rig_from_rest,
            },
            blend: self.deformation.as_ref().map(|timeline| {
                let span = timeline.span(time_s);
                (span.keys, span.weights())
            }),
        }
    }
}

/// The vertices, scaled, of the meshes that an object's own becomes.
///
/// # Errors
/// Files that cannot be read, or whose triangles are not those of the object's own mesh.
pub(super) fn keys(scene: &Scene, object: &Object, mesh: &Mesh) -> Result<Vec<Vec<DVec3>>> {
    let Some(deform) = &object.deform else {
        return Ok(Vec::new());
    };
    let total = deform.keyframes.len().saturating_mul(mesh.vertices.len());
    if total > MAX_KEY_VERTICES {
        return Err(Error::input(
            "deform.keyframes",
            format!("{total} vertices in all keyframes"),
            format!("up to {MAX_KEY_VERTICES} vertices"),
        ));
    }
    let read = |(i, key): (usize, &crate::profile::MeshKeyframe)| {
        let place = format!("deform.keyframes[{i}].file");
        let path = scene.folder.join(&key.file);
        let found = Mesh::read(&path).map_err(|e| e.at(&place))?;
        let (vertices, triangles) = (mesh.vertices.len(), mesh.triangles.len());
        if found.vertices.len() != vertices || found.triangles.len() != triangles {
            let (found_v, found_t) = (found.vertices.len(), found.triangles.len());
            return Err(Error::input(
                format!("{place}: {}", path.display()),
                format!("{found_v} vertices and {found_t} triangles"),
                format!("{vertices} and {triangles}, as the object's own mesh has them"),
            ));
        }
        let differs = (0..triangles).find(|&t| found.triangles[t] != mesh.triangles[t]);
        if let Some(t) = differs {
            return Err(Error::input(
                format!("{place}: {}: triangle {t}", path.display()),
                format!("vertices {:?}", found.triangles[t]),
                format!("{:?}, as in the object's own mesh", mesh.triangles[t]),
            ));
        }
        Ok(found.vertices.iter().map(|&v| v * object.scale).collect())
    };
    deform.keyframes.iter().enumerate().map(read).collect()
}
