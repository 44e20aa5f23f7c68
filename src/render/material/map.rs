//! Variation of an object's albedo over its surface: a texture, placed by the mesh's texture
//! coordinates or mapped onto the shape, or the ink of a board.

use super::lay::Lay;
use super::spot::{Spot, barycentric, shares};
use super::texture::Texture;
use glam::{DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Board, Mesh, Pose};
use phasmid_profile::{Object, Scene};
use std::sync::Arc;

/// Minimum fraction of ink, and of paper, in a footprint that counts as lying on an outline.
const EDGE: f64 = 1e-4;

pub(crate) enum Map {
    Image(ImageMap),
    Board(Printed),
}

pub(crate) struct ImageMap {
    pub(crate) texture: Arc<Texture>,
    pub(crate) place: Place,
}

pub(crate) enum Place {
    /// Texture coordinates at the corners of the object's triangles, with v pointing up.
    Corners(Vec<[[f32; 2]; 3]>),
    /// Mapped onto the shape with this size in millimetres.
    Over {
        lay: Lay,
        size_mm: DVec2,
        object_from_rig: Pose,
    },
}

impl Map {
    pub(super) fn image(texture: Arc<Texture>, scene: &Scene, object: &Object) -> Self {
        Self::Image(ImageMap::new(texture, scene, object))
    }

    pub(super) fn board(board: Board, ink: f64, scene: &Scene, object: &Object) -> Self {
        Self::Board(Printed::new(board, ink, scene, object))
    }

    /// Stores the texture coordinates of the object's mesh.
    ///
    /// # Errors
    /// Returns an error if the mesh has no texture coordinates and the scene sets no texture size.
    pub(super) fn take(&mut self, mesh: &Mesh) -> Result<()> {
        match self {
            Self::Image(image) => image.take(mesh),
            Self::Board(_) => Ok(()),
        }
    }

    /// Returns the mean albedo over a spot's footprint, with the object in its rest pose. `index` is
    /// the triangle's index within the object.
    pub(crate) fn albedo(&self, index: usize, spot: &Spot) -> f64 {
        match self {
            Self::Image(image) => image.albedo(index, spot),
            Self::Board(printed) => printed.albedo(spot),
        }
    }

    /// Returns whether a footprint with this mean albedo lies on an outline, where the variation of
    /// light within the footprint matters. Always false except for boards, whose outlines are
    /// measured.
    pub(crate) fn is_edge(&self, mean: f64) -> bool {
        match self {
            Self::Image(_) => false,
            Self::Board(printed) => {
                let ink = (1.0 - mean) / (1.0 - printed.ink);
                ink > EDGE && ink < 1.0 - EDGE
            }
        }
    }
}

impl ImageMap {
    fn new(texture: Arc<Texture>, scene: &Scene, object: &Object) -> Self {
        let place = match object.texture_size_mm {
            Some(size) => Place::Over {
                lay: Lay::new(&object.shape),
                size_mm: DVec2::from_array(size),
                object_from_rig: scene.rig_from_object(object).inverse(),
            },
            None => Place::Corners(Vec::new()),
        };
        Self { texture, place }
    }

    fn take(&mut self, mesh: &Mesh) -> Result<()> {
        let Place::Corners(uv) = &mut self.place else {
            return Ok(());
        };
        if mesh.uv.is_empty() {
            return Err(Error::input(
                "texture",
                "a mesh without texture coordinates",
                "a PLY file with s and t, an OBJ file with vt, or texture_size_mm",
            ));
        }
        uv.clone_from(&mesh.uv);
        Ok(())
    }

    fn albedo(&self, index: usize, spot: &Spot) -> f64 {
        let Spot {
            corners,
            point,
            normal,
            sides,
        } = *spot;
        let (at, [across, down]) = match &self.place {
            Place::Corners(uv) => {
                let (Some(uv), Some(corners)) = (uv.get(index), corners) else {
                    return 1.0;
                };
                // Image rows run downwards.
                let uv = uv.map(|[u, v]| DVec2::new(u.into(), 1.0 - f64::from(v)));
                let blend = |w: [f64; 3]| (0..3).map(|i| uv[i] * w[i]).sum::<DVec2>();
                let side = |side| blend(shares(corners, side));
                (blend(barycentric(corners, point)), sides.map(side))
            }
            Place::Over {
                lay,
                size_mm,
                object_from_rig,
            } => {
                let local = object_from_rig.point(point);
                let laid = lay.at(local, object_from_rig.direction(normal));
                let side = |side| {
                    let side = object_from_rig.direction(side);
                    DVec2::from_array(laid.gradient.map(|g| g.dot(side))) / *size_mm
                };
                (laid.at / *size_mm + 0.5, sides.map(side))
            }
        };
        self.texture.average(at, across, down)
    }
}

/// A board printed on the side facing -z in the object's own frame.
pub(crate) struct Printed {
    /// The board, scaled in the same way as its object.
    pub(crate) board: Board,
    /// Factor on the albedo where the board has ink.
    pub(crate) ink: f64,
    pub(crate) object_from_rig: Pose,
}

impl Printed {
    fn new(board: Board, ink: f64, scene: &Scene, object: &Object) -> Self {
        Self {
            board: board.scaled(object.scale),
            ink,
            object_from_rig: scene.rig_from_object(object).inverse(),
        }
    }

    /// Returns the mean albedo over the footprint of a spot with the object in its rest pose.
    fn albedo(&self, spot: &Spot) -> f64 {
        let own = |v: DVec3| self.object_from_rig.direction(v);
        if !(own(spot.normal).z < 0.0) {
            return 1.0;
        }
        let at = self.object_from_rig.point(spot.point).truncate();
        let [across, down] = spot.sides.map(|side| own(side).truncate());
        1.0 - (1.0 - self.ink) * self.board.ink(at, across, down)
    }
}
