//! A generated patient on the couch: what planning knows, and the truth at any moment.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, Pose};
use phasmid_phantom::{Day, Patient, Phantom, State};
use phasmid_planning::planning::Planning;
use phasmid_profile::{Scene, Shape};
use phasmid_sgrt::{ModelOptions, Planned, Region, room_from_patient};
use std::path::Path;

/// Distance of the voxels of the displacement fields in millimetres.
const SPACING_MM: f64 = 5.0;
/// Triangles of the skin whose points are the ideal input: other points than those of planning.
const IDEAL_TRIANGLES: u32 = 43_000;
/// Level of the true tumour's mesh, 5120 triangles.
const TARGET_LEVEL: u32 = 4;
/// The scene that patients lie in.
const SCENE: &str = "treatment-room";

/// A patient in the treatment room.
pub struct InRoom {
    /// The truth.
    pub phantom: Phantom,
    /// What planning knows.
    pub planned: Planned,
    /// The room with the patient on the couch.
    pub scene: Scene,
    ideal: Mesh,
}

/// The truth at a moment, in the room's frame.
pub struct Moment {
    state: State,
    /// Centroid of the tumour in millimetres.
    pub tumour_mm: DVec3,
    /// The tumour, closed.
    pub tumour: Mesh,
}

impl InRoom {
    /// A built-in patient, planned in a scratch folder that is made and removed, with the skin that a
    /// region holds.
    ///
    /// # Errors
    /// A name that no patient has, and what the system refuses.
    pub fn new(name: &str, region: &Region, scratch: &Path) -> Result<Self> {
        let phantom = Phantom::new(&Patient::load(name)?);
        phantom.export_planning(scratch, SPACING_MM, false, false)?;
        let planning = Planning::load(scratch);
        std::fs::remove_dir_all(scratch).map_err(|e| Error::io(scratch, e))?;
        let planned = Planned::new(&planning?, region, &ModelOptions::default())?;
        let mut scene = Scene::load(SCENE)?;
        for object in &mut scene.object {
            if let Shape::Patient { patient, .. } = &mut object.shape {
                name.clone_into(patient);
                object.skin = Some(phantom.patient().skin);
            }
        }
        Ok(Self {
            ideal: phantom.skin(IDEAL_TRIANGLES)?,
            phantom,
            planned,
            scene,
        })
    }

    /// The truth at a device time of the day of treatment.
    pub fn at(&self, time_ns: u64) -> Moment {
        let state = self.phantom.state(Day::Treatment, time_ns as f64 * 1e-9);
        let room = room_from_patient();
        Moment {
            tumour_mm: room.point(self.phantom.target(&state).centroid_mm).into(),
            tumour: stood(&room, self.phantom.tumour_mesh(&state, TARGET_LEVEL)),
            state,
        }
    }

    /// Points of the true skin at a moment, evenly over all of it that a box of the room holds.
    pub fn skin(&self, moment: &Moment, [lo, hi]: [DVec3; 2]) -> Vec<DVec3> {
        let skin = self.phantom.deformed(&self.ideal, &moment.state);
        let mut points = stood(&room_from_patient(), skin).vertices;
        points.retain(|p| p.cmpge(lo).all() && p.cmple(hi).all());
        points
    }
}

fn stood(room: &Pose, mut mesh: Mesh) -> Mesh {
    for v in &mut mesh.vertices {
        *v = room.point(*v);
    }
    mesh
}
