//! A scene: what stands before the scanner, where the scanner stands, and the light that is not the
//! projector's. Without a `[rig]` the scene's frame is the rig's.

use super::{Ambient, Interreflection, Light, Object, TomlSource};
use super::{builtin, interreflection, light, object};
use glam::DVec3;
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_geometry::Pose;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Objects and light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name by which it is chosen.
    pub name: String,
    /// One line for listings.
    pub description: String,
    /// Where the rig stands.
    #[serde(default)]
    pub rig: RigPlace,
    /// Light from everywhere.
    #[serde(default)]
    pub ambient: Ambient,
    /// Lamps.
    #[serde(default)]
    pub light: Vec<Light>,
    /// Light that surfaces throw on each other; left out when absent.
    #[serde(default)]
    pub interreflection: Option<Interreflection>,
    /// What can be seen; later objects win nothing over earlier ones.
    #[serde(default)]
    pub object: Vec<Object>,
    /// Folder that mesh files are relative to; the scene file's own.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Where the rig stands in the scene: its frame is the camera's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigPlace {
    /// Camera's pupil in the scene's frame in millimetres.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the scene's fixed x, then y, then z axis.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
}

impl Scene {
    /// Takes the scene's coordinates to the rig's.
    pub fn rig_from_scene(&self) -> Pose {
        Pose::from_xyz_deg(
            DVec3::from_array(self.rig.position_mm),
            DVec3::from_array(self.rig.rotation_deg),
        )
        .inverse()
    }

    /// Takes an object's own coordinates, after scaling, to the rig's.
    pub fn rig_from_object(&self, object: &Object) -> Pose {
        self.rig_from_scene() * object.scene_from_object()
    }

    /// Loads a built-in scene by its name, or else a file by its path.
    ///
    /// # Errors
    /// A name that is neither, unreadable files, and all that [`Self::parse`] refuses.
    pub fn load(name_or_path: &str) -> Result<Self> {
        let (source, folder) = builtin::scene_source(name_or_path)?;
        Self::from_source(&source, folder)
    }

    /// Reads and checks a scene from text; `place` stands for the file in messages.
    ///
    /// # Errors
    /// Syntax, unknown fields, wrong types and impossible values, each with its line.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place), PathBuf::new())
    }

    fn from_source(source: &TomlSource, folder: PathBuf) -> Result<Self> {
        let mut scene: Self = source.deserialize()?;
        check(&scene, &Check::new(source))?;
        scene.folder = folder;
        for (i, object) in scene.object.iter_mut().enumerate() {
            let place = || source.place_of(&format!("object[{i}].shape.patient"));
            object.settle(&scene.folder).map_err(|e| e.at(place()))?;
        }
        Ok(scene)
    }
}

fn check(s: &Scene, check: &Check<'_>) -> Result<()> {
    name(&s.name, "name", check)?;
    check.all_within("rig.position_mm", &s.rig.position_mm, -1e9..=1e9)?;
    check.all_within("rig.rotation_deg", &s.rig.rotation_deg, -360.0..=360.0)?;
    light::check(&s.ambient, &s.light, check)?;
    if let Some(interreflection) = s.interreflection {
        interreflection::check(interreflection, check)?;
    }
    check.that(
        s.object.len() <= 4096,
        "object",
        format!("{} objects", s.object.len()),
        "up to 4096 objects",
    )?;
    s.object
        .iter()
        .enumerate()
        .try_for_each(|(i, o)| object::check(o, &format!("object[{i}]"), check))
}
