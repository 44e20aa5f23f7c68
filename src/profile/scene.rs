//! A scene: what stands before the scanner, in the rig's frame, and the light that is not the
//! projector's.

use super::check::{Check, name};
use super::{Ambient, Light, Object, TomlSource, builtin, light, object};
use crate::error::Result;
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
    /// Light from everywhere.
    #[serde(default)]
    pub ambient: Ambient,
    /// Lamps.
    #[serde(default)]
    pub light: Vec<Light>,
    /// What can be seen; later objects win nothing over earlier ones.
    #[serde(default)]
    pub object: Vec<Object>,
    /// Folder that mesh files are relative to; the scene file's own.
    #[serde(skip)]
    pub folder: PathBuf,
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
        check(&scene, &Check::new(source))?;
        Ok(scene)
    }
}

fn check(s: &Scene, check: &Check<'_>) -> Result<()> {
    name(&s.name, "name", check)?;
    light::check(&s.ambient, &s.light, check)?;
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
