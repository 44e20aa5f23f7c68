//! The scene as devices share it: where its objects are now, and where they were.
//!
//! Each device renders its own copy of the scene. An object that is placed through one of them is
//! put down here; every device looks here before it exposes again, and takes over what is new.

use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_geometry::Pose;
use phasmid_phantom::{Day, Phantom};
use phasmid_profile::{Object, RigPlace, Scene, Shape};
use phasmid_protocol::service::{ObjectAbout, Objects, PatientAbout, PlaceAbout, Placement};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Changes of place that are remembered.
const MAX_MOVES: usize = 4096;

/// A scene that several devices look at.
#[derive(Clone)]
pub struct Stage {
    shared: Arc<Mutex<Shared>>,
}

struct Shared {
    scene: Scene,
    /// Changes of place so far.
    version: u64,
    /// For each object the version that came of its last change of place.
    placed: Vec<u64>,
    /// Where objects were before the newest changes.
    moves: VecDeque<Move>,
    /// Those of the objects that are patients.
    patients: Vec<Option<Patient>>,
}

/// A patient, and how it lies there.
struct Patient {
    phantom: Phantom,
    day: Day,
    held_percent: Option<f64>,
}

impl Patient {
    /// An object's; none of what is no patient, and of one that cannot be read, which the renderer
    /// says.
    fn of(scene: &Scene, object: &Object) -> Option<Self> {
        let Shape::Patient {
            day, held_percent, ..
        } = object.shape
        else {
            return None;
        };
        let patient = object.shape.patient(&scene.folder).ok()??;
        Some(Self {
            phantom: Phantom::new(&patient),
            day,
            held_percent,
        })
    }

    /// At a device time, of an object of a scale in a place.
    fn about(&self, time_ns: u64, scale: f64, scene_from_object: &Pose) -> PatientAbout {
        let state = match self.held_percent {
            Some(percent) => self.phantom.held(self.day, percent / 100.0),
            None => self.phantom.state(self.day, time_ns as f64 * 1e-9),
        };
        let target = self.phantom.target(&state);
        PatientAbout {
            phase: state.phase,
            tumour_mm: scene_from_object
                .point(target.centroid_mm * scale)
                .to_array(),
            tumour_mm3: target.volume_mm3 * scale.powi(3),
        }
    }
}

/// A change of place.
struct Move {
    /// The version that came of it.
    version: u64,
    before: Placement,
}

impl Stage {
    /// A scene as its file says.
    pub fn new(scene: &Scene) -> Self {
        Self {
            shared: Arc::new(Mutex::new(Shared {
                placed: vec![0; scene.object.len()],
                patients: scene.object.iter().map(|o| Patient::of(scene, o)).collect(),
                scene: scene.clone(),
                version: 0,
                moves: VecDeque::new(),
            })),
        }
    }

    /// Takes an object elsewhere, for all devices, and gives the place where it was.
    ///
    /// # Errors
    /// What [`Scene::place`] refuses; nothing has changed then.
    pub(super) fn place(&self, placement: Placement) -> Result<Placement> {
        let mut shared = self.shared();
        let at = placement.object as usize;
        let before = shared.scene.object.get(at).map(|object| Placement {
            object: placement.object,
            position_mm: object.position_mm,
            rotation_deg: object.rotation_deg,
        });
        let (position_mm, rotation_deg) = (placement.position_mm, placement.rotation_deg);
        shared.scene.place(at, position_mm, rotation_deg)?;
        let before = before.unwrap_or(placement);
        shared.version += 1;
        let version = shared.version;
        shared.placed[at] = version;
        shared.moves.push_back(Move { version, before });
        if shared.moves.len() > MAX_MOVES {
            shared.moves.pop_front();
        }
        Ok(before)
    }

    /// What has been placed since a version, and the version now.
    pub(super) fn since(&self, version: u64) -> (Vec<Placement>, u64) {
        let shared = self.shared();
        if shared.version == version {
            return (Vec::new(), version);
        }
        let objects = shared.placed.iter().enumerate();
        let newer = objects.filter(|(_, placed)| **placed > version);
        let placements = newer.map(|(at, _)| shared.placement(at)).collect();
        (placements, shared.version)
    }

    /// Where the objects whose place has changed since a version were then; `None` if that is
    /// forgotten.
    pub(super) fn back_to(&self, version: u64) -> Option<Vec<Placement>> {
        self.shared().back_to(version)
    }

    /// Where the objects whose numbers these placements have are now.
    pub(super) fn now(&self, of: &[Placement]) -> Vec<Placement> {
        let shared = self.shared();
        of.iter()
            .map(|placement| shared.placement(placement.object as usize))
            .collect()
    }

    /// The objects at a device time, as they were placed at a version; `rig` is where the rig of
    /// the device that is asked stands. `None` if that version is forgotten.
    pub(super) fn objects(&self, time_ns: u64, version: u64, rig: RigPlace) -> Option<Objects> {
        let shared = self.shared();
        let mut objects = shared.scene.object.clone();
        for was in shared.back_to(version)? {
            let object = &mut objects[was.object as usize];
            object.position_mm = was.position_mm;
            object.rotation_deg = was.rotation_deg;
        }
        let about = |(object, number): (&Object, u32)| {
            let place = place(object, time_ns);
            let [at, turn] = [place.position_mm, place.rotation_deg].map(DVec3::from_array);
            let patient = shared.patients[number as usize].as_ref();
            ObjectAbout {
                object: number,
                shape: kind(&object.shape).to_owned(),
                moves: object.motion.as_ref().is_some_and(|m| m.goes_anywhere()),
                deforms: object.deform.is_some() || object.shape.breathes(),
                patient: patient.map(|patient| {
                    patient.about(time_ns, object.scale, &Pose::from_xyz_deg(at, turn))
                }),
                place,
            }
        };
        Some(Objects {
            time_ns,
            rig: PlaceAbout {
                position_mm: rig.position_mm,
                rotation_deg: rig.rotation_deg,
            },
            objects: objects.iter().zip(0..).map(about).collect(),
        })
    }

    fn shared(&self) -> MutexGuard<'_, Shared> {
        // A device that has died leaves nothing half done here.
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    fn placement(&self, at: usize) -> Placement {
        let object = &self.scene.object[at];
        Placement {
            object: at as u32,
            position_mm: object.position_mm,
            rotation_deg: object.rotation_deg,
        }
    }

    fn back_to(&self, version: u64) -> Option<Vec<Placement>> {
        let oldest = self.moves.front().map_or(self.version, |m| m.version - 1);
        if version < oldest {
            return None;
        }
        let mut back: Vec<Placement> = Vec::new();
        for change in self.moves.iter().rev() {
            if change.version <= version {
                break;
            }
            // The oldest of the changes since then counts.
            let object = change.before.object;
            match back.iter_mut().find(|placement| placement.object == object) {
                Some(placement) => *placement = change.before,
                None => back.push(change.before),
            }
        }
        Some(back)
    }
}

/// Where an object is, before scaling, in the scene's frame.
fn place(object: &Object, time_ns: u64) -> PlaceAbout {
    let moved = match &object.motion {
        Some(motion) if motion.goes_anywhere() => motion.trajectory().pose(time_ns as f64 * 1e-9),
        // The numbers of the file, to the last digit.
        _ => {
            return PlaceAbout {
                position_mm: object.position_mm,
                rotation_deg: object.rotation_deg,
            };
        }
    };
    let pose: Pose = object.scene_from_object() * moved;
    let (position_mm, rotation_deg) = pose.to_xyz_deg();
    PlaceAbout {
        position_mm: position_mm.to_array(),
        rotation_deg: rotation_deg.to_array(),
    }
}

fn kind(shape: &Shape) -> &'static str {
    match shape {
        Shape::Plane { .. } => "plane",
        Shape::Board { .. } => "board",
        Shape::Sphere { .. } => "sphere",
        Shape::Cylinder { .. } => "cylinder",
        Shape::Frustum { .. } => "frustum",
        Shape::Torso { .. } => "torso",
        Shape::Couch { .. } => "couch",
        Shape::LinacHead { .. } => "linac-head",
        Shape::Patient { .. } => "patient",
        Shape::Mesh { .. } => "mesh",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"s\"\ndescription = \"\"\n\
        [[object]]\nshape = { kind = \"plane\" }\nalbedo = 0.5\n\
        [[object]]\nshape = { kind = \"sphere\", radius_mm = 9.0 }\nalbedo = 0.5\n\
        position_mm = [0.0, 0.0, 500.0]\n\
        motion = { keyframes = [{ time_s = 0.0 }, { time_s = 2.0, position_mm = [8.0, 0.0, 0.0] }] }\n";

    fn placement(x: f64) -> Placement {
        Placement {
            object: 0,
            position_mm: [x, 0.0, 0.0],
            rotation_deg: [0.0; 3],
        }
    }

    #[test]
    fn what_is_placed_is_told_once_and_can_be_undone() {
        let stage = Stage::new(&Scene::parse(TEXT, "test").unwrap());
        let other = stage.clone();
        assert_eq!(other.since(0), (vec![], 0));
        assert_eq!(stage.place(placement(1.0)).unwrap(), placement(0.0));
        assert_eq!(stage.place(placement(2.0)).unwrap(), placement(1.0));
        assert!(
            stage
                .place(Placement {
                    object: 1,
                    ..placement(3.0)
                })
                .is_err()
        );
        assert!(
            stage
                .place(Placement {
                    object: 9,
                    ..placement(3.0)
                })
                .is_err()
        );
        assert_eq!(other.since(0), (vec![placement(2.0)], 2));
        assert_eq!(other.since(2), (vec![], 2));
        for (version, was) in [
            (0, vec![placement(0.0)]),
            (1, vec![placement(1.0)]),
            (2, vec![]),
        ] {
            assert_eq!(other.back_to(version), Some(was.clone()));
            assert_eq!(other.now(&was), vec![placement(2.0); was.len()]);
        }
        for x in 0..5000 {
            stage.place(placement(f64::from(x))).unwrap();
        }
        assert_eq!(stage.back_to(900), None, "it is bounded");
        assert_eq!(stage.back_to(1000), Some(vec![placement(997.0)]));
        assert_eq!(stage.shared().moves.len(), MAX_MOVES);
    }

    #[test]
    fn a_patient_has_a_tumour() {
        let scene = Scene::load("treatment-room").unwrap();
        let stage = Stage::new(&scene);
        let about = |time_s: u64| {
            let now = stage.objects(time_s * 1_000_000_000, 0, scene.rig).unwrap();
            let patients: Vec<_> = now.objects.iter().filter_map(|o| o.patient).collect();
            assert_eq!(patients.len(), 1, "the couch has none");
            patients[0]
        };
        // The planning isocentre is the room's origin; what is left is set-up and breathing.
        let breath: Vec<_> = (0..5).map(about).collect();
        for now in &breath {
            let [x, y, z] = now.tumour_mm;
            assert!((0.0..1.0).contains(&now.phase) && now.tumour_mm3 > 100.0);
            assert!(DVec3::new(x, y, z).length() < 40.0, "{now:?}");
        }
        assert!(
            breath
                .iter()
                .any(|b| (b.tumour_mm[1] - breath[0].tumour_mm[1]).abs() > 1.0)
        );
    }

    #[test]
    fn objects_are_where_they_were_then() {
        let stage = Stage::new(&Scene::parse(TEXT, "test").unwrap());
        let rig = RigPlace {
            position_mm: [1.0, 2.0, 3.0],
            rotation_deg: [0.0; 3],
        };
        stage.place(placement(5.0)).unwrap();
        let now = stage.objects(1_000_000_000, 1, rig).unwrap();
        assert_eq!(now.rig.position_mm, [1.0, 2.0, 3.0]);
        assert_eq!(now.objects[0].place.position_mm, [5.0, 0.0, 0.0]);
        assert!(!now.objects[0].moves && now.objects[1].moves);
        assert_eq!(now.objects[1].shape, "sphere");
        let [x, y, z] = now.objects[1].place.position_mm;
        assert!((x - 4.0).abs() < 1e-9 && y == 0.0 && z == 500.0);
        let then = stage.objects(0, 0, rig).unwrap();
        assert_eq!(then.objects[0].place.position_mm, [0.0; 3]);
        assert_eq!(then.objects[1].place.position_mm, [0.0, 0.0, 500.0]);
    }
}
