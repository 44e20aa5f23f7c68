//! Planning data of a patient in the room frame: the reference surface and the motion model.

use super::model::{ModelOptions, MotionModel, Snapshots};
use super::surface::{Reference, Region};
use glam::{DMat3, DVec3, Vec3};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, Pose};
use phasmid_measure::solid_moments;
use phasmid_planning::planning::Planning;
use phasmid_planning::volume::Field;
use std::path::Path;

/// A patient as planned, head first and supine, in the room frame with the isocentre at its origin.
pub struct Planned {
    /// The skin at the reference phase.
    pub reference: Reference,
    /// The motion model of skin and tumour.
    pub model: MotionModel,
    /// The tumour at the reference phase.
    pub tumour: Mesh,
}

impl Planned {
    /// Reads a planning folder, for the skin of the chest ([`Region::chest`]) and a motion model with
    /// default options.
    ///
    /// # Errors
    /// Returns an error as [`Planning::load`] and [`Self::new`] do.
    pub fn load(folder: impl AsRef<Path>) -> Result<Self> {
        let planning = Planning::load(folder.as_ref())?;
        Self::new(&planning, &Region::chest(), &ModelOptions::default())
    }

    /// Builds the planned patient from the content of a planning folder; `region` is the tracked part
    /// of the skin.
    ///
    /// # Errors
    /// Returns an error if a displacement field does not cover all of skin and tumour, if the region
    /// contains no skin, or if the phases contain no motion.
    pub fn new(planning: &Planning, region: &Region, options: &ModelOptions) -> Result<Self> {
        let room = room_from_patient();
        let stood = |mesh: &Mesh| Mesh {
            vertices: mesh.vertices.iter().map(|v| room.point(*v)).collect(),
            ..mesh.clone()
        };
        let mut snapshots = Snapshots::default();
        for (percent, field) in &planning.phases {
            let of = |mesh: &Mesh, what: &str| {
                moved(field, mesh, &room).map_err(|e| e.at(format!("{what}, phase {percent} %")))
            };
            snapshots.skin.push(of(&planning.skin, "skin")?);
            snapshots.tumour.push(of(&planning.tumour, "tumour")?);
        }
        let tumour = stood(&planning.tumour);
        Ok(Self {
            reference: Reference::new(&stood(&planning.skin), region)?,
            model: MotionModel::new(&snapshots, &tumour, options)?,
            tumour,
        })
    }

    /// Returns the planned position of the tumour's centroid, in millimetres.
    pub fn tumour_mm(&self) -> DVec3 {
        solid_moments(&self.tumour.vertices, &self.tumour.triangles).1
    }
}

/// Returns the pose from the patient's frame (LPS about the isocentre) to the room frame for a
/// patient lying head first and supine: left is right as seen from the foot end, the head is towards
/// the gantry, the back down.
pub fn room_from_patient() -> Pose {
    Pose {
        rotation: DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        translation_mm: DVec3::ZERO,
    }
}

/// Displacements of a mesh's vertices by a field, along the room's axes.
fn moved(field: &Field, mesh: &Mesh, room: &Pose) -> Result<Vec<Vec3>> {
    let each = mesh.vertices.iter().map(|v| {
        let found = field.at(*v).ok_or_else(|| {
            Error::input(
                "displacement field",
                format!("no displacement at {v}"),
                "a field that covers skin and tumour",
            )
        })?;
        Ok(room.direction(found).as_vec3())
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_supine_patient_looks_up_with_the_head_to_the_gantry() {
        let room = room_from_patient();
        for (lps, iec) in [
            (DVec3::X, DVec3::X),
            (DVec3::Y, DVec3::NEG_Z),
            (DVec3::Z, DVec3::Y),
        ] {
            assert_eq!(room.direction(lps), iec);
        }
        assert_eq!(room.rotation.determinant(), 1.0);
        // Agrees with `rotation_deg` of a patient in a scene.
        let scene = Pose::from_xyz_deg(DVec3::ZERO, DVec3::new(-90.0, 0.0, 0.0));
        assert!((scene.rotation * DVec3::Y - DVec3::NEG_Z).length() < 1e-15);
    }
}
