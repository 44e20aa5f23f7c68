//! A generated patient on the couch: the planning data, and the truth at any time.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, Pose};
use phasmid_phantom::{Day, Patient, Phantom, State};
use phasmid_planning::planning::Planning;
use phasmid_profile::{Scene, Shape};
use phasmid_sgrt::{ModelOptions, Planned, Region, room_from_patient};
use std::path::Path;

/// Voxel spacing of the displacement fields in millimetres.
const SPACING_MM: f64 = 5.0;
/// Number of triangles of the skin whose vertices are the ideal input; the planning skin has other
/// vertices.
const IDEAL_TRIANGLES: u32 = 43_000;
/// Subdivision level of the true tumour's mesh, which has 5120 triangles.
const TARGET_LEVEL: u32 = 4;
/// The scene with the couch.
const SCENE: &str = "treatment-room";

/// A patient in the treatment room.
pub struct InRoom {
    /// The true patient.
    pub phantom: Phantom,
    /// The planning data.
    pub planned: Planned,
    /// The room with the patient on the couch.
    pub scene: Scene,
    ideal: Mesh,
}

/// The truth at one time, in the room's frame.
pub struct Moment {
    state: State,
    /// Centroid of the tumour in millimetres.
    pub tumour_mm: DVec3,
    /// The tumour, closed.
    pub tumour: Mesh,
}

impl InRoom {
    /// Creates a built-in patient. The planning folder is written to `scratch` and removed again; the
    /// planning data track the skin within `region`.
    ///
    /// # Errors
    /// Returns an error if there is no such patient, or on I/O failure.
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

    /// Returns the truth at a device time on the day of treatment.
    pub fn at(&self, time_ns: u64) -> Moment {
        let state = self.phantom.state(Day::Treatment, time_ns as f64 * 1e-9);
        let room = room_from_patient();
        Moment {
            tumour_mm: room.point(self.phantom.target(&state).centroid_mm).into(),
            tumour: stood(&room, self.phantom.tumour_mesh(&state, TARGET_LEVEL)),
            state,
        }
    }

    /// Returns evenly spread points of the true skin at a moment, within a box of the room.
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
