//! The scene shared by several devices: the present and past poses of its objects.
//!
//! Each device renders its own copy of the scene. An object moved through one device is recorded
//! here, and every device updates its copy before its next exposure.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::source::Setting;
use phasmid_geometry::Pose;
use phasmid_phantom::{Day, Phantom};
use phasmid_profile::{Object, RigPlace, Scene, Shape};
use phasmid_protocol::service::{ObjectAbout, Objects, PatientAbout, PlaceAbout, Placement};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Maximum number of moves recorded.
const MAX_MOVES: usize = 4096;

/// A scene that several devices share; clones refer to the same scene.
#[derive(Clone)]
pub struct SharedScene {
    shared: Arc<Mutex<Shared>>,
}

struct Shared {
    scene: Scene,
    /// Version of the scene: number of moves and other changes so far.
    version: u64,
    /// Version of the scene after the last change that was not a move.
    changed: u64,
    /// For each object, the version after its last move.
    placed: Vec<u64>,
    /// Poses of objects before each of the latest moves.
    moves: VecDeque<Move>,
    /// The scene before a change that the optics have neither applied nor rejected yet.
    pending: Option<Scene>,
    /// For each object, its patient; `None` if the object is not a patient.
    patients: Vec<Option<Patient>>,
}

/// A patient and its position on the couch.
struct Patient {
    phantom: Phantom,
    day: Day,
    held_percent: Option<f64>,
}

impl Patient {
    /// Returns the patient of an object. Returns `None` if the object is not a patient or its
    /// patient cannot be read, which the renderer reports.
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

    /// Describes the patient at a device time, for an object with this scale and pose.
    fn about(&self, time_ns: u64, scale: f64, scene_from_object: &Pose) -> PatientAbout {
        let state = match self.held_percent {
            Some(percent) => self.phantom.held(self.day, percent / 100.0),
            None => self.phantom.state(self.day, time_ns as f64 * 1e-9),
        };
        let target = self.phantom.target(&state);
        PatientAbout {
            phase: state.phase,
            tumour_mm: scene_from_object.point(target.centroid_mm.map(|x| x * scale)),
            tumour_mm3: target.volume_mm3 * scale.powi(3),
        }
    }
}

/// A change of a scene.
#[derive(Debug, PartialEq)]
pub(super) enum Change {
    /// The present poses of the objects that were moved.
    Moves(Vec<Placement>),
    /// The whole scene, after a change that was not only moves.
    Scene(Box<Scene>),
}

/// A move of an object.
struct Move {
    /// Version of the scene after the move.
    version: u64,
    before: Placement,
}

impl SharedScene {
    /// Returns a shared scene with the objects as described by the scene's file.
    pub fn new(scene: &Scene) -> Self {
        Self {
            shared: Arc::new(Mutex::new(Shared {
                placed: vec![0; scene.object.len()],
                patients: scene.object.iter().map(|o| Patient::of(scene, o)).collect(),
                scene: scene.clone(),
                version: 0,
                changed: 0,
                pending: None,
                moves: VecDeque::new(),
            })),
        }
    }

    /// Moves an object for all devices and returns its previous pose.
    ///
    /// # Errors
    /// Returns the error of [`Scene::place`], or an error if another change waits to be settled.
    /// After an error, nothing has changed.
    pub(super) fn place(&self, placement: Placement) -> Result<Placement> {
        let mut shared = self.shared();
        shared.check()?;
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

    /// Sets a field of the scene for all devices; the caller must then call [`Self::settle`].
    /// Recorded poses of objects are discarded, because they belong to the previous scene.
    ///
    /// # Errors
    /// Returns the error of [`Scene::set`], or an error if another change waits to be settled.
    /// After an error, nothing has changed.
    pub(super) fn set(&self, setting: Setting) -> Result<()> {
        let mut shared = self.shared();
        shared.check()?;
        let mut scene = shared.scene.clone();
        scene.set(setting)?;
        let before = shared.change(scene);
        shared.pending = Some(before);
        Ok(())
    }

    /// Keeps the change of the last [`Self::set`] if the optics have applied it (`followed`), or
    /// undoes it if they have rejected it.
    pub(super) fn settle(&self, followed: bool) {
        let mut shared = self.shared();
        if let Some(before) = shared.pending.take()
            && !followed
        {
            shared.change(before);
        }
    }

    /// Returns the present scene.
    pub(super) fn scene(&self) -> Scene {
        self.shared().scene.clone()
    }

    /// Returns the changes since a version, and the present version.
    pub(super) fn since(&self, version: u64) -> (Change, u64) {
        let shared = self.shared();
        let change = if shared.changed > version {
            Change::Scene(Box::new(shared.scene.clone()))
        } else if shared.version == version {
            Change::Moves(Vec::new())
        } else {
            let objects = shared.placed.iter().enumerate();
            let newer = objects.filter(|(_, placed)| **placed > version);
            Change::Moves(newer.map(|(at, _)| shared.placement(at)).collect())
        };
        (change, shared.version)
    }

    /// Returns the poses, at a version, of the objects that have moved since then; `None` if these
    /// poses are no longer recorded.
    pub(super) fn back_to(&self, version: u64) -> Option<Vec<Placement>> {
        self.shared().back_to(version)
    }

    /// Returns the present poses of the objects that `of` lists.
    pub(super) fn now(&self, of: &[Placement]) -> Vec<Placement> {
        let shared = self.shared();
        // Objects may have been removed since `of` was recorded.
        of.iter()
            .map(|placement| placement.object as usize)
            .filter(|at| *at < shared.scene.object.len())
            .map(|at| shared.placement(at))
            .collect()
    }

    /// Returns the objects at a device time, posed as at a version of the scene, for a device whose
    /// rig is at `rig`; `None` if that version is no longer recorded.
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
        // A device that panicked leaves no partial change here.
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    fn check(&self) -> Result<()> {
        match self.pending {
            None => Ok(()),
            Some(_) => Err(Error::device(
                "scene: another change is being made; try again",
            )),
        }
    }

    /// Replaces the scene and returns the previous one.
    fn change(&mut self, scene: Scene) -> Scene {
        self.version += 1;
        self.changed = self.version;
        self.moves.clear();
        self.placed = vec![self.version; scene.object.len()];
        self.patients = scene
            .object
            .iter()
            .map(|o| Patient::of(&scene, o))
            .collect();
        std::mem::replace(&mut self.scene, scene)
    }

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
            // The oldest move since that version holds the object's pose at that version.
            let object = change.before.object;
            match back.iter_mut().find(|placement| placement.object == object) {
                Some(placement) => *placement = change.before,
                None => back.push(change.before),
            }
        }
        Some(back)
    }
}

/// Returns the pose of an object in the scene's frame, before scaling.
fn place(object: &Object, time_ns: u64) -> PlaceAbout {
    let moved = match &object.motion {
        Some(motion) if motion.goes_anywhere() => motion.trajectory().pose(time_ns as f64 * 1e-9),
        // Return the numbers of the scene's file without rounding.
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
        position_mm,
        rotation_deg,
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
    fn placements_are_reported_once_and_can_be_undone() {
        let shared_scene = SharedScene::new(&Scene::parse(TEXT, "test").unwrap());
        let other = shared_scene.clone();
        let moves = |moves, version| (Change::Moves(moves), version);
        assert_eq!(other.since(0), moves(vec![], 0));
        assert_eq!(shared_scene.place(placement(1.0)).unwrap(), placement(0.0));
        assert_eq!(shared_scene.place(placement(2.0)).unwrap(), placement(1.0));
        assert!(
            shared_scene
                .place(Placement {
                    object: 1,
                    ..placement(3.0)
                })
                .is_err()
        );
        assert!(
            shared_scene
                .place(Placement {
                    object: 9,
                    ..placement(3.0)
                })
                .is_err()
        );
        assert_eq!(other.since(0), moves(vec![placement(2.0)], 2));
        assert_eq!(other.since(2), moves(vec![], 2));
        for (version, was) in [
            (0, vec![placement(0.0)]),
            (1, vec![placement(1.0)]),
            (2, vec![]),
        ] {
            assert_eq!(other.back_to(version), Some(was.clone()));
            assert_eq!(other.now(&was), vec![placement(2.0); was.len()]);
        }
        for x in 0..5000 {
            shared_scene.place(placement(f64::from(x))).unwrap();
        }
        assert_eq!(shared_scene.back_to(900), None, "the history is bounded");
        assert_eq!(shared_scene.back_to(1000), Some(vec![placement(997.0)]));
        assert_eq!(shared_scene.shared().moves.len(), MAX_MOVES);
    }

    #[test]
    fn change_of_the_scene_is_reported_whole_and_can_be_put_back() {
        let shared_scene = SharedScene::new(&Scene::parse(TEXT, "test").unwrap());
        shared_scene.place(placement(1.0)).unwrap();
        let before = shared_scene.scene();
        let set = |text: &str| shared_scene.set(text.parse().unwrap());
        set("object[0].albedo=0.25").unwrap();
        assert!(
            set("object[0].albedo=0.3").is_err(),
            "only one change at a time"
        );
        assert!(shared_scene.place(placement(3.0)).is_err());
        let Change::Scene(now) = shared_scene.since(1).0 else {
            panic!("the scene has changed");
        };
        assert_eq!((before.object[0].albedo, now.object[0].albedo), (0.5, 0.25));
        assert_eq!(now.object[0].position_mm, [1.0, 0.0, 0.0]);
        assert_eq!(shared_scene.since(2), (Change::Moves(vec![]), 2));
        assert_eq!(
            shared_scene.back_to(1),
            None,
            "the history was discarded with the old scene"
        );
        assert_eq!(shared_scene.back_to(2), Some(vec![]));
        shared_scene.settle(true);
        assert!(set("object[0].albedo=9").is_err());
        set("object[0].albedo=0.3").unwrap();
        shared_scene.settle(false);
        assert_eq!(shared_scene.scene(), *now);
        set("object[0].albedo=0.5").unwrap();
        shared_scene.settle(true);
        assert_eq!(shared_scene.scene(), before);
    }

    #[test]
    fn patient_reports_its_moving_tumour() {
        let scene = Scene::load("treatment-room").unwrap();
        let shared_scene = SharedScene::new(&scene);
        let about = |time_s: u64| {
            let now = shared_scene
                .objects(time_s * 1_000_000_000, 0, scene.rig)
                .unwrap();
            let patients: Vec<_> = now.objects.iter().filter_map(|o| o.patient).collect();
            assert_eq!(patients.len(), 1, "only the patient has anatomy");
            patients[0]
        };
        // The planning isocentre is the origin of the room; the remaining distance is set-up error
        // and breathing.
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
    fn objects_are_reported_at_their_past_places() {
        let shared_scene = SharedScene::new(&Scene::parse(TEXT, "test").unwrap());
        let rig = RigPlace {
            position_mm: [1.0, 2.0, 3.0],
            rotation_deg: [0.0; 3],
        };
        shared_scene.place(placement(5.0)).unwrap();
        let now = shared_scene.objects(1_000_000_000, 1, rig).unwrap();
        assert_eq!(now.rig.position_mm, [1.0, 2.0, 3.0]);
        assert_eq!(now.objects[0].place.position_mm, [5.0, 0.0, 0.0]);
        assert!(!now.objects[0].moves && now.objects[1].moves);
        assert_eq!(now.objects[1].shape, "sphere");
        let [x, y, z] = now.objects[1].place.position_mm;
        assert!((x - 4.0).abs() < 1e-9 && y == 0.0 && z == 500.0);
        let then = shared_scene.objects(0, 0, rig).unwrap();
        assert_eq!(then.objects[0].place.position_mm, [0.0; 3]);
        assert_eq!(then.objects[1].place.position_mm, [0.0, 0.0, 500.0]);
    }
}
