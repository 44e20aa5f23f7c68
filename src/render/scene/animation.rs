//! Animation of objects: motion and deformation over time, and the state of all moving objects at an
//! instant.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, Pose, Timeline, Trajectory};
use phasmid_phantom::{Day, Phantom};
use phasmid_profile::{Object, Scene, Shape};

/// Maximum total number of vertices in the meshes of a deformation, which take 1.2 GB.
const MAX_KEY_VERTICES: usize = 50_000_000;

/// An object that moves.
pub(crate) struct Animation {
    pub(crate) object: u16,
    pub(crate) part: Part,
    pub(crate) rig_from_rest: Pose,
    trajectory: Option<Trajectory>,
    deformation: Option<Deformation>,
}

/// Deformation of a mesh.
enum Deformation {
    /// Interpolation between keyframes.
    Keys(Timeline),
    /// Breathing of a patient.
    Breath(Box<Phantom>, Day),
}

impl Deformation {
    fn of(scene: &Scene, object: &Object) -> Result<Option<Self>> {
        if let Some(deform) = &object.deform {
            return Ok(Some(Self::Keys(deform.timeline())));
        }
        let Shape::Patient { day, .. } = object.shape else {
            return Ok(None);
        };
        let patient = object.shape.patient(&scene.folder)?;
        let patient = patient.filter(|_| object.shape.breathes());
        Ok(patient.map(|patient| Self::Breath(Box::new(Phantom::new(&patient)), day)))
    }

    fn blend(&self, time_s: f64) -> Blend {
        match self {
            Self::Keys(timeline) => {
                let span = timeline.span(time_s);
                (span.keys, span.weights())
            }
            Self::Breath(phantom, day) => {
                let state = phantom.state(*day, time_s);
                ([0, 1, 2, 3], phantom.skin_weights(&state))
            }
        }
    }

    /// Returns the maximum distance in millimetres by which a vertex may move beyond the keyframe
    /// meshes.
    fn reach_mm(&self) -> f64 {
        match self {
            Self::Keys(_) => 0.0,
            // A breathing mode displaces tissue by at most twice its weight.
            Self::Breath(phantom, _) => {
                let bounds = phantom.weight_bounds_mm();
                bounds
                    .iter()
                    .map(|b| 2.0 * b[0].abs().max(b[1].abs()))
                    .sum()
            }
        }
    }
}

/// Index of an object among the solids or the moving meshes of the world.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Part {
    Solid(usize),
    Instance(usize),
}

/// Pose and shape of an object at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    pub(crate) rig_from_object: Pose,
    pub(crate) blend: Option<Blend>,
}

/// Indices of the keyframes that are blended into a shape, and their weights.
pub(crate) type Blend = ([usize; 4], [f64; 4]);

/// State, at an instant, of everything that moves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct State(pub(crate) Vec<Placement>);

impl Animation {
    pub(crate) fn new(scene: &Scene, object: &Object, index: u16, part: Part) -> Result<Self> {
        Ok(Self {
            object: index,
            part,
            rig_from_rest: scene.rig_from_object(object),
            trajectory: object.motion.as_ref().map(|m| m.trajectory()),
            deformation: Deformation::of(scene, object)?,
        })
    }

    /// Returns the maximum displacement from rest, in millimetres, by the trajectory and by
    /// breathing. Displacements by the keyframes of a deformation are not included.
    pub(crate) fn reach_mm(&self) -> f64 {
        let carried = self.trajectory.as_ref().map_or(0.0, Trajectory::reach_mm);
        carried + self.deformation.as_ref().map_or(0.0, Deformation::reach_mm)
    }

    /// Returns the object's placement at a device time in nanoseconds.
    pub(crate) fn at(&self, time_ns: f64) -> Placement {
        let time_s = time_ns * 1e-9;
        Placement {
            rig_from_object: match &self.trajectory {
                Some(trajectory) => self.rig_from_rest * trajectory.pose(time_s),
                None => self.rig_from_rest,
            },
            blend: self.deformation.as_ref().map(|d| d.blend(time_s)),
        }
    }
}

/// Returns the vertices, scaled, of the meshes of an object's deformation.
///
/// # Errors
/// Returns an error if a file cannot be read or if its triangles differ from the object's own mesh.
pub(crate) fn keys(scene: &Scene, object: &Object, mesh: &Mesh) -> Result<Vec<Vec<DVec3>>> {
    if let Shape::Patient { triangles, day, .. } = object.shape
        && object.shape.breathes()
        && let Some(patient) = object.shape.patient(&scene.folder)?
    {
        let phantom = Phantom::new(&patient);
        let (keys, setup) = (phantom.skin_keys(triangles)?, phantom.setup(day));
        // The weights of a blend add up to 1, so the rigid transform may be applied before blending.
        let placed = |v: DVec3| setup.point(v) * object.scale;
        let key = |mesh: Mesh| mesh.vertices.into_iter().map(placed).collect();
        return Ok(keys.map(key).into());
    }
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
    let read = |(i, key): (usize, &phasmid_profile::MeshKeyframe)| {
        let place = format!("deform.keyframes[{i}].file");
        let path = scene.folder.join(&key.file);
        let found = Mesh::read(&path).map_err(|e| e.at(&place))?;
        let (vertices, triangles) = (mesh.vertices.len(), mesh.triangles.len());
        if found.vertices.len() != vertices || found.triangles.len() != triangles {
            let (found_v, found_t) = (found.vertices.len(), found.triangles.len());
            return Err(Error::input(
                format!("{place}: {}", path.display()),
                format!("{found_v} vertices and {found_t} triangles"),
                format!("{vertices} and {triangles}, as in the object's own mesh"),
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
