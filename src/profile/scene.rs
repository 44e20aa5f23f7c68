//! A scene: what stands before the scanner, in the rig's frame, and the light that is not the
//! projector's.

use super::check::{self, Check};
use super::{TomlSource, builtin};
use crate::error::Result;
use crate::geometry::Pose;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Objects and ambient light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name by which it is chosen.
    pub name: String,
    /// One line for listings.
    pub description: String,
    /// Light from everywhere.
    #[serde(default)]
    pub ambient: Ambient,
    /// What can be seen; later objects win nothing over earlier ones.
    #[serde(default)]
    pub object: Vec<Object>,
    /// Folder that mesh files are relative to; the scene file's own.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Constant light that falls on every surface alike.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ambient {
    /// Irradiance in W/m^2 at the projector's wavelength.
    pub irradiance_w_m2: f64,
}

/// A shape with its place and its surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// What it is, in its own frame.
    pub shape: Shape,
    /// Its origin in the rig's frame in millimetres.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis.
    #[serde(default)]
    pub rotation_deg: [f64; 3],
    /// Factor on its size, before rotation and position.
    #[serde(default = "one")]
    pub scale: f64,
    /// Diffuse reflectance of its Lambertian surface, 0 to 1.
    pub albedo: f64,
}

fn one() -> f64 {
    1.0
}

/// Shapes in their own frame, in millimetres. They stand on their z = 0 plane and rise towards
/// -z, which is towards a camera that looks along +z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// The plane z = 0, endless or a rectangle about the origin.
    Plane {
        /// Sides along x and y; endless when absent.
        #[serde(default)]
        size_mm: Option<[f64; 2]>,
    },
    /// A sphere about the origin.
    Sphere {
        /// Radius.
        radius_mm: f64,
    },
    /// A closed cylinder about the origin, its axis along y.
    Cylinder {
        /// Radius.
        radius_mm: f64,
        /// Length along y.
        length_mm: f64,
    },
    /// A square frustum, its base at z = 0 and its top at z = -height.
    Frustum {
        /// Side of the base.
        base_mm: f64,
        /// Side of the top.
        top_mm: f64,
        /// Height.
        height_mm: f64,
    },
    /// A human torso lying on its back, generated.
    Torso {
        /// Variation of the body.
        #[serde(default)]
        seed: u64,
        /// Size along y.
        #[serde(default = "torso_length")]
        length_mm: f64,
        /// Size along x.
        #[serde(default = "torso_width")]
        width_mm: f64,
        /// Size along z.
        #[serde(default = "torso_depth")]
        depth_mm: f64,
        /// About how many triangles.
        #[serde(default = "torso_triangles")]
        triangles: u32,
    },
    /// A treatment couch top, generated.
    Couch {},
    /// A triangle mesh from a file.
    Mesh {
        /// STL, OBJ or PLY, relative to the scene file.
        file: PathBuf,
    },
}

fn torso_length() -> f64 {
    500.0
}
fn torso_width() -> f64 {
    380.0
}
fn torso_depth() -> f64 {
    220.0
}
fn torso_triangles() -> u32 {
    65_000
}

impl Scene {
    /// Loads a built-in scene by its name, or else a file by its path.
    ///
    /// # Errors
    /// A name that is neither, unreadable files, and all that [`Self::parse`] refuses.
    pub fn load(name_or_path: &str) -> Result<Self> {
        let (source, folder) = builtin::scene_source(name_or_path)?;
        let mut scene = Self::from_source(&source)?;
        scene.folder = folder;
        Ok(scene)
    }

    /// Reads and checks a scene from text; `place` stands for the file in messages.
    ///
    /// # Errors
    /// Syntax, unknown fields, wrong types and impossible values, each with its line.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    fn from_source(source: &TomlSource) -> Result<Self> {
        let scene: Self = source.deserialize()?;
        check::scene(&scene, &Check::new(source))?;
        Ok(scene)
    }
}

impl Object {
    /// Takes the object's own coordinates, after scaling, to the rig's.
    pub fn rig_from_object(&self) -> Pose {
        Pose::from_xyz_deg(
            DVec3::from_array(self.position_mm),
            DVec3::from_array(self.rotation_deg),
        )
    }
}
