//! The object on the couch (a rigid torso, a patient who holds the breath, or a plain body), and the
//! motion of the couch.

use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_geometry::{Mesh, Pose, shapes};
use phasmid_phantom::tissue::Skin;
use phasmid_phantom::{Day, Phantom, REFERENCE_PHASE, SKIN_TRIANGLES};
use phasmid_profile::{Keyframe, Motion, Object, Scene, Shape};
use phasmid_sgrt::{Reference, Region, SixDof};

/// The room; its first object is the couch, its second object the patient.
const ROOM: &str = "treatment-room";
/// The room with the linac's head as its third object.
const ROOM_WITH_HEAD: &str = "treatment-room-head";
/// The patient: a man of average size.
const PATIENT: &str = "p02-man-mean";
/// Seed of the torso, chosen so that it is asymmetric.
const TORSO: u64 = 1;
/// Radius of the sphere and of the cylinder in millimetres, about the radius of a breast or a thigh.
const RADIUS_MM: f64 = 100.0;
/// Side of the flat phantom and length of the cylinder in millimetres.
const SIDE_MM: f64 = 600.0;
/// Reflectance of plastic phantoms: the reflectance of skin, for which the pods' light is designed.
const PLASTICS: f64 = 0.4;
/// Time between two poses of the couch in seconds of device time: it moves for one second and rests for
/// three.
const APART_S: f64 = 4.0;

/// An object to scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Body {
    /// An opaque, rigid torso.
    Torso,
    /// A patient at the reference phase of planning, with the breath held; optionally with a
    /// Fitzpatrick class.
    Patient(Option<u8>),
    /// A flat board through the isocentre.
    Flat,
    /// A sphere about the isocentre.
    Sphere,
    /// A cylinder along the couch about the isocentre.
    Cylinder,
}

impl Body {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Torso => "torso",
            Self::Patient(_) => "patient",
            Self::Flat => "flat",
            Self::Sphere => "sphere",
            Self::Cylinder => "cylinder",
        }
    }

    /// Returns how far a point of the room lies outside a plain body in its planned pose, in closed
    /// form, in millimetres; 0 for torso and patients.
    pub(super) fn outside_mm(self, p: DVec3) -> f64 {
        match self {
            Self::Torso | Self::Patient(_) => 0.0,
            Self::Flat => p.z,
            Self::Sphere => p.length() - RADIUS_MM,
            Self::Cylinder => p.x.hypot(p.z) - RADIUS_MM,
        }
    }
}

/// A subject in the room.
pub(super) struct Subject {
    /// The scene with the subject in its planned pose.
    pub(super) scene: Scene,
    /// True surface in the planned pose, in millimetres in the room's frame.
    pub(super) surface: Mesh,
    /// Default region for tracking.
    pub(super) region: Region,
}

impl Subject {
    /// Creates a subject on the couch.
    ///
    /// # Errors
    /// Returns an error if a built-in file is invalid.
    pub(super) fn new(body: Body) -> Result<Self> {
        Self::in_room(body, Scene::load(ROOM)?)
    }

    /// Like [`Self::new`], with the linac's head at a gantry angle in degrees.
    ///
    /// # Errors
    /// Returns the errors of [`Self::new`].
    pub(super) fn under_head(body: Body, gantry_deg: f64) -> Result<Self> {
        let mut scene = Scene::load(ROOM_WITH_HEAD)?;
        for object in &mut scene.object {
            if object.shape == (Shape::LinacHead {}) {
                object.rotation_deg[1] = gantry_deg;
            }
        }
        Self::in_room(body, scene)
    }

    fn in_room(body: Body, mut scene: Scene) -> Result<Self> {
        let mut surface = Mesh::default();
        for object in &mut scene.object {
            if let Shape::Patient { .. } = object.shape {
                let own = lay(object, body, &scene.folder)?;
                let stand = object.scene_from_object();
                surface = Mesh {
                    vertices: own.vertices.iter().map(|v| stand.point(*v)).collect(),
                    ..own
                };
            }
        }
        Ok(Self {
            scene,
            surface,
            region: region(body),
        })
    }

    /// Returns the surface, prepared for tracking in its default region.
    ///
    /// # Errors
    /// Returns an error if the region contains no surface.
    pub(super) fn reference(&self) -> Result<Reference> {
        Reference::new(&self.surface, &self.region)
    }

    /// Returns the scene in which the couch moves the subject through `poses`, which are displacements
    /// from the planned pose about the isocentre. The couch rests at pose `k` around [`time_ns`].
    pub(super) fn on_the_way(&self, poses: &[SixDof]) -> Scene {
        let mut scene = self.scene.clone();
        for object in &mut scene.object {
            if object.shape != (Shape::LinacHead {}) {
                object.motion = Some(way(poses, &object.scene_from_object()));
            }
        }
        scene
    }
}

/// Returns a displacement of some millimetres and degrees in all six directions.
pub(super) fn everywhere(sign: f64) -> SixDof {
    SixDof {
        translation_mm: DVec3::new(4.0, -3.0, 5.0) * sign,
        rotation_deg: DVec3::new(1.0, -1.5, 0.8) * sign,
    }
}

/// Returns the device time in nanoseconds at which the couch rests at pose `k`; a scan that begins at
/// this time ends before the couch moves on.
pub(super) fn time_ns(k: usize) -> u64 {
    ((k as f64 * APART_S + 1.2) * 1e9) as u64
}

/// Creates a motion whose keyframes repeat each pose four times, a second apart, so that the spline
/// rests at the pose.
fn way(poses: &[SixDof], rest: &Pose) -> Motion {
    let keys = poses.iter().enumerate().flat_map(|(k, six)| {
        let moved = rest.inverse() * six.pose() * *rest;
        let (position, rotation) = moved.to_xyz_deg();
        (0..4).map(move |i| Keyframe {
            time_s: k as f64 * APART_S + f64::from(i),
            position_mm: position,
            rotation_deg: rotation,
        })
    });
    Motion {
        period_s: None,
        keyframes: keys.collect(),
    }
}

/// Replaces the scene's patient by the body, and returns its surface in the object's own frame.
fn lay(object: &mut Object, body: Body, folder: &std::path::Path) -> Result<Mesh> {
    if let Body::Patient(tone) = body {
        object.shape = Shape::Patient {
            patient: PATIENT.to_owned(),
            day: Day::Planning,
            held_percent: Some(REFERENCE_PHASE as f64 * 10.0),
            triangles: SKIN_TRIANGLES,
        };
        let Some(patient) = object.shape.patient(folder)? else {
            return Ok(Mesh::default());
        };
        object.skin = Some(match tone {
            None => patient.skin,
            Some(class) => Skin {
                fitzpatrick: Some(class),
                absorption_per_mm: None,
                reduced_scattering_per_mm: None,
                ..patient.skin
            },
        });
        // At the reference phase all displacements are 0.
        return Phantom::new(&patient).skin(SKIN_TRIANGLES);
    }
    object.skin = None;
    object.albedo = PLASTICS;
    object.rotation_deg = [0.0; 3];
    Ok(match body {
        Body::Torso => {
            let torso = shapes::Torso {
                seed: TORSO,
                ..shapes::Torso::default()
            };
            object.shape = Shape::Torso {
                seed: torso.seed,
                length_mm: torso.length_mm,
                width_mm: torso.width_mm,
                depth_mm: torso.depth_mm,
                triangles: torso.triangles,
            };
            // The torso lies on the couch with its head towards the gantry.
            object.position_mm = [0.0, 0.0, -130.0];
            object.rotation_deg = [180.0, 0.0, 0.0];
            shapes::torso(&torso)
        }
        Body::Sphere => {
            object.shape = Shape::Sphere {
                radius_mm: RADIUS_MM,
            };
            patch(360, |at| {
                let slope = at * 65f64.to_radians();
                DVec3::new(slope.x.tan(), slope.y.tan(), 1.0).normalize() * RADIUS_MM
            })
        }
        Body::Cylinder => {
            object.shape = Shape::Cylinder {
                radius_mm: RADIUS_MM,
                length_mm: SIDE_MM,
            };
            patch(360, |at| {
                let (sin, cos) = (at.x * 80f64.to_radians()).sin_cos();
                DVec3::new(RADIUS_MM * sin, at.y * SIDE_MM / 2.0, RADIUS_MM * cos)
            })
        }
        Body::Flat | Body::Patient(_) => {
            object.shape = Shape::Plane {
                size_mm: Some([SIDE_MM; 2]),
            };
            patch(120, |at| (at * SIDE_MM / 2.0).extend(0.0))
        }
    })
}

/// Creates a surface over the square from -1 to 1 along x and y with `pieces` cells per side,
/// counter-clockwise as seen from above.
fn patch(pieces: u32, at: impl Fn(DVec2) -> DVec3) -> Mesh {
    let place = |k: u32| f64::from(k) / f64::from(pieces) * 2.0 - 1.0;
    let row = |j: u32| (0..=pieces).map(move |i| (i, j));
    let vertices = (0..=pieces)
        .flat_map(row)
        .map(|(i, j)| at(DVec2::new(place(i), place(j))));
    let index = |i: u32, j: u32| j * (pieces + 1) + i;
    let squares = (0..pieces).flat_map(|j| (0..pieces).map(move |i| (i, j)));
    let triangles = squares.flat_map(|(i, j)| {
        let [a, b] = [index(i, j), index(i + 1, j)];
        let [c, d] = [index(i, j + 1), index(i + 1, j + 1)];
        // Alternate the diagonals, so that the mesh has no preferred direction.
        match (i + j) % 2 {
            0 => [[a, b, d], [a, d, c]],
            _ => [[a, b, c], [b, d, c]],
        }
    });
    Mesh {
        vertices: vertices.collect(),
        triangles: triangles.collect(),
        ..Mesh::default()
    }
}

/// Returns the tracked region of a body: the skin around the isocentre for torso and patients, and the
/// surface away from all edges for plain bodies.
fn region(body: Body) -> Region {
    let from = |x: f64, y: f64, z: f64| Region::Box {
        lo: DVec3::new(-x, -y, z),
        hi: DVec3::new(x, y, 2.0 * RADIUS_MM),
    };
    match body {
        Body::Torso | Body::Patient(_) => Region::chest(),
        Body::Flat => from(200.0, 200.0, -50.0),
        Body::Sphere => from(RADIUS_MM, RADIUS_MM, 0.5 * RADIUS_MM),
        Body::Cylinder => from(RADIUS_MM, 200.0, 0.4 * RADIUS_MM),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_geometry::MeshTree;

    #[test]
    fn the_couch_takes_the_subject_along() {
        let six = |x: f64, roll: f64| SixDof {
            translation_mm: DVec3::new(x, 0.0, -5.0),
            rotation_deg: DVec3::new(0.0, roll, 1.0),
        };
        let poses = [SixDof::default(), six(20.0, -2.0), six(-10.0, 3.0)];
        let subject = Subject::new(Body::Torso).unwrap();
        let scene = subject.on_the_way(&poses);
        for object in &scene.object {
            let rest = object.scene_from_object();
            let trajectory = object.motion.as_ref().unwrap().trajectory();
            for (k, six) in poses.iter().enumerate() {
                // Test from a second after the couch's arrival until a second before its departure.
                for s in [-0.19, 0.0, 0.79] {
                    let now = rest * trajectory.pose(time_ns(k) as f64 * 1e-9 + s);
                    let wanted = six.pose() * rest;
                    for p in [DVec3::ZERO, DVec3::new(100.0, -200.0, 50.0)] {
                        assert!(now.point(p).distance(wanted.point(p)) < 1e-9, "{k} {s}");
                    }
                }
            }
        }
    }

    #[test]
    fn surfaces_are_those_of_the_scene_and_look_up() {
        for body in [Body::Flat, Body::Sphere, Body::Cylinder] {
            let subject = Subject::new(body).unwrap();
            let tree = MeshTree::new(&subject.surface);
            // Points of the surface straight above the isocentre, and beside it.
            for (x, y) in [(0.0, 0.0), (40.0, 30.0)] {
                let height: f64 = match body {
                    Body::Flat => 0.0,
                    Body::Sphere => f64::sqrt(RADIUS_MM * RADIUS_MM - x * x - y * y),
                    _ => f64::sqrt(RADIUS_MM * RADIUS_MM - x * x),
                };
                let near = tree.closest(DVec3::new(x, y, height)).unwrap();
                assert!(near.point.distance(DVec3::new(x, y, height)) < 0.01);
            }
            let reference = subject.reference().unwrap();
            let normals = reference.region_normals();
            assert!(normals.iter().all(|(_, n)| n.z > 0.3), "{}", body.name());
        }
        // The highest point of torso and patient is 50 to 250 mm above the isocentre.
        for body in [Body::Torso, Body::Patient(Some(6))] {
            let subject = Subject::new(body).unwrap();
            let (lo, hi) = subject.surface.bounds().unwrap();
            assert!(lo.z > -135.0 && (50.0..250.0).contains(&hi.z), "{lo} {hi}");
            subject.reference().unwrap();
        }
    }
}
