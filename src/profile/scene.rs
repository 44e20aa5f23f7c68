//! Scene: objects in front of the scanner, the pose of the rig, and light other than the
//! projector's. Without a section `[rig]`, the scene's frame is the rig's frame.

use super::{Ambient, Interreflection, Light, Object, Settings, TomlSource};
use super::{builtin, interreflection, light, object};
use glam::DVec3;
use phasmid_core::check::{Check, name};
use phasmid_core::error::Result;
use phasmid_geometry::Pose;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Objects and light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name used to select the scene.
    pub name: String,
    /// One line for listings.
    #[serde(default)]
    pub description: String,
    /// Pose of the rig.
    #[serde(default)]
    pub rig: RigPlace,
    /// Ambient light.
    #[serde(default)]
    pub ambient: Ambient,
    /// Lamps.
    #[serde(default)]
    pub light: Vec<Light>,
    /// Indirect light between surfaces; not computed when absent.
    #[serde(default)]
    pub interreflection: Option<Interreflection>,
    /// Visible objects; their order has no effect on visibility.
    #[serde(default)]
    pub object: Vec<Object>,
    /// Folder of the scene file, to which mesh file paths are relative.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Pose of the rig in the scene; the rig's frame is the camera's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RigPlace {
    /// Position of the camera's pupil in the scene's frame in millimetres.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the scene's fixed x, then y, then z axis.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
}

impl Scene {
    /// Returns the pose that maps scene coordinates to rig coordinates.
    pub fn rig_from_scene(&self) -> Pose {
        Pose::from_xyz_deg(
            DVec3::from_array(self.rig.position_mm),
            DVec3::from_array(self.rig.rotation_deg),
        )
        .inverse()
    }

    /// Returns the pose that maps an object's coordinates, after scaling, to rig coordinates.
    pub fn rig_from_object(&self, object: &Object) -> Pose {
        self.rig_from_scene() * object.scene_from_object()
    }

    /// Loads a built-in scene by its name, or else a file by its path.
    ///
    /// # Errors
    /// Returns an error if the name is neither built in nor a file, if the file cannot be read, or
    /// if [`Self::parse`] fails.
    pub fn load(name_or_path: &str) -> Result<Self> {
        Self::load_with(name_or_path, &Settings::default())
    }

    /// Loads a scene as [`Self::load`] does, with settings that override its fields.
    ///
    /// # Errors
    /// Returns an error as [`Self::load`] does, or if a setting names no field or an invalid value.
    pub fn load_with(name_or_path: &str, settings: &Settings) -> Result<Self> {
        let (source, folder) = builtin::scene_source(name_or_path)?;
        Self::from_source(&source.with(&settings.scene), folder)
    }

    /// Returns the TOML text of a scene exactly as in its file.
    ///
    /// # Errors
    /// Returns an error as [`Self::load`] does.
    pub fn text(name_or_path: &str) -> Result<String> {
        Self::load(name_or_path)?;
        let (source, _) = builtin::scene_source(name_or_path)?;
        Ok(source.text().to_owned())
    }

    /// Returns the TOML of a scene, merged with the documents that it extends and with settings,
    /// without comments.
    ///
    /// # Errors
    /// Returns an error as [`Self::load_with`] does.
    pub fn full_text(name_or_path: &str, settings: &Settings) -> Result<String> {
        Self::load_with(name_or_path, settings)?;
        let (source, _) = builtin::scene_source(name_or_path)?;
        source.with(&settings.scene).to_toml()
    }

    /// Parses and checks a scene; `place` is the file name used in messages.
    ///
    /// # Errors
    /// Returns an error with its line on a syntax error, an unknown field, a wrong type or an
    /// invalid value.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::parse_with(text, place, &Settings::default())
    }

    /// Parses a scene as [`Self::parse`] does, with settings that override its fields.
    ///
    /// # Errors
    /// Returns an error as [`Self::parse`] does, or if a setting names no field or an invalid value.
    pub fn parse_with(text: &str, place: &str, settings: &Settings) -> Result<Self> {
        let source = builtin::extended_scene(TomlSource::new(text, place), Path::new(""))?;
        Self::from_source(&source.with(&settings.scene), PathBuf::new())
    }

    pub(super) fn from_source(source: &TomlSource, folder: PathBuf) -> Result<Self> {
        let mut scene = Check::read(source, |scene: &mut Self, all| check(scene, all))?;
        scene.folder = folder;
        for (i, object) in scene.object.iter_mut().enumerate() {
            let place = || source.place_of(&format!("object[{i}].shape.patient"));
            object.settle(&scene.folder).map_err(|e| e.at(place()))?;
        }
        Ok(scene)
    }
}

fn check(s: &Scene, check: &Check<'_>) -> Result<()> {
    check.section(|check| name(&s.name, "name", check));
    check.all_within("rig.position_mm", &s.rig.position_mm, -1e9..=1e9)?;
    check.all_within("rig.rotation_deg", &s.rig.rotation_deg, -360.0..=360.0)?;
    check.section(|check| light::check(&s.ambient, &s.light, check));
    if let Some(interreflection) = s.interreflection {
        check.section(|check| interreflection::check(interreflection, check));
    }
    check.that(
        s.object.len() <= 4096,
        "object",
        format!("{} objects", s.object.len()),
        "up to 4096 objects",
    )?;
    for (i, o) in s.object.iter().enumerate() {
        check.section(|check| object::check(o, &format!("object[{i}]"), check));
    }
    Ok(())
}
