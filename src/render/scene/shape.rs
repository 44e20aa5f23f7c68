//! Conversion of the shapes in a scene to geometry for ray casting: closed forms or triangles.

use glam::DVec2;
use phasmid_core::error::Result;
use phasmid_geometry::{Mesh, Solid, shapes};
use phasmid_phantom::{Phantom, REFERENCE_PHASE};
use phasmid_profile::Shape;
use std::path::Path;

/// Breathing phase of the skin of a patient at rest: the reference phase as a fraction of the cycle.
const REST: f64 = REFERENCE_PHASE as f64 / 10.0;

/// Returns the closed form of a shape, scaled; `None` for meshes.
pub(crate) fn solid(shape: &Shape, scale: f64) -> Option<Solid> {
    Some(match *shape {
        Shape::Plane { size_mm } => Solid::Plane {
            half: size_mm.map_or(DVec2::INFINITY, |s| DVec2::from_array(s) * scale / 2.0),
        },
        Shape::Board { ref board, .. } => Solid::Plane {
            half: board.sheet_mm() * scale / 2.0,
        },
        Shape::Sphere { radius_mm } => Solid::Sphere {
            radius: radius_mm * scale,
        },
        Shape::Cylinder {
            radius_mm,
            length_mm,
        } => Solid::Cylinder {
            radius: radius_mm * scale,
            half_length: length_mm * scale / 2.0,
        },
        Shape::Frustum {
            base_mm,
            top_mm,
            height_mm,
        } => Solid::frustum(base_mm * scale, top_mm * scale, height_mm * scale),
        Shape::Torso { .. }
        | Shape::Couch {}
        | Shape::LinacHead {}
        | Shape::Patient { .. }
        | Shape::Mesh { .. } => return None,
    })
}

/// Returns the triangles of a shape without a closed form.
pub(crate) fn mesh(shape: &Shape, folder: &Path) -> Result<Mesh> {
    match *shape {
        Shape::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        } => Ok(shapes::torso(&shapes::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        })),
        Shape::Couch {} => Ok(shapes::couch(&shapes::Couch::default())),
        Shape::LinacHead {} => Ok(shapes::linac_head()),
        Shape::Patient {
            day,
            held_percent,
            triangles,
            ..
        } => {
            let Some(patient) = shape.patient(folder)? else {
                return Ok(Mesh::default());
            };
            let phantom = Phantom::new(&patient);
            let state = phantom.held(day, held_percent.map_or(REST, |percent| percent / 100.0));
            Ok(phantom.deformed(&phantom.skin(triangles)?, &state))
        }
        Shape::Mesh { ref file } => Mesh::read(&folder.join(file)),
        Shape::Plane { .. }
        | Shape::Board { .. }
        | Shape::Sphere { .. }
        | Shape::Cylinder { .. }
        | Shape::Frustum { .. } => Ok(Mesh::default()),
    }
}
