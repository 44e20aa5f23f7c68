//! Changing a scene at run time.

use super::object::{POSITION_MM, ROTATION_DEG};
use super::{Motion, Scene, Settings, TomlSource};
use phasmid_core::error::{Error, Result};
use phasmid_core::source::Setting;

impl Scene {
    /// Sets the position and rotation of an object; both have the same meaning as in the scene's
    /// file. `object` is the object's index in the file, from 0.
    ///
    /// # Errors
    /// Returns an error if the object does not exist or is animated, or if a number is outside the
    /// range allowed in a file. The scene is then unchanged.
    pub fn place(
        &mut self,
        object: usize,
        position_mm: [f64; 3],
        rotation_deg: [f64; 3],
    ) -> Result<()> {
        for (field, numbers, allowed) in [
            ("position_mm", position_mm, POSITION_MM),
            ("rotation_deg", rotation_deg, ROTATION_DEG),
        ] {
            if let Some(beyond) = numbers.iter().find(|number| !allowed.contains(number)) {
                let allowed = format!("{} to {}", allowed.start(), allowed.end());
                return Err(Error::input(format!("place.{field}"), beyond, allowed));
            }
        }
        let count = self.object.len();
        let refused = |found: &str, allowed: String| {
            Err(Error::input(
                "place.object",
                format!("{object}, {found}"),
                allowed,
            ))
        };
        let Some(placed) = self.object.get_mut(object) else {
            return refused(
                &format!("in a scene of {count} objects"),
                match count {
                    0 => "none: the scene is empty".to_owned(),
                    _ => format!("0 to {}", count - 1),
                },
            );
        };
        if placed.motion.as_ref().is_some_and(Motion::goes_anywhere) {
            return refused(
                "which moves along a path",
                "an object without motion".to_owned(),
            );
        }
        placed.position_mm = position_mm;
        placed.rotation_deg = rotation_deg;
        Ok(())
    }

    /// Sets a field, as `--set` does. Only the pose of the rig cannot be set.
    ///
    /// # Errors
    /// Returns an error if the field does not exist or the value is invalid. The scene is then unchanged.
    pub fn set(&mut self, setting: Setting) -> Result<()> {
        let settings = Settings::new([setting])?;
        let refused = |setting: &Setting, found: &str| {
            Err(Error::input(setting.place(), found, "a field of the scene"))
        };
        match (settings.profile().first(), settings.scene().first()) {
            (Some(setting), _) => return refused(setting, "a field of the profile"),
            (_, Some(setting)) if setting.section() == "rig" => {
                return refused(setting, "the pose of the rig, which is the device's own");
            }
            _ => {}
        }
        let text = toml::to_string(self).map_err(Error::device)?;
        let source = TomlSource::new(&text, "scene").with(settings.scene());
        *self = Self::from_source(&source, self.folder.clone())?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"s\"\ndescription = \"\"\n\
        [[object]]\nshape = { kind = \"plane\" }\nalbedo = 0.5\n\
        [[object]]\nshape = { kind = \"sphere\", radius_mm = 9.0 }\nalbedo = 0.5\n\
        motion = { keyframes = [{ time_s = 0.0 }, { time_s = 1.0, position_mm = [1.0, 0.0, 0.0] }] }\n";

    #[test]
    fn refused_placement_names_the_field_and_changes_nothing() {
        let mut scene = Scene::parse(TEXT, "test").unwrap();
        let before = scene.clone();
        for (object, position, rotation, needles) in [
            (2, 0.0, 0.0, ["place.object: 2", "0 to 1"]),
            (1, 0.0, 0.0, ["1, which moves", "without motion"]),
            (
                0,
                2e9,
                0.0,
                ["place.position_mm: 2000000000", "-1000000000 to 1000000000"],
            ),
            (0, f64::NAN, 0.0, ["NaN", "-1000000000 to 1000000000"]),
            (0, 0.0, 361.0, ["place.rotation_deg: 361", "-360 to 360"]),
        ] {
            let refused = scene.place(object, [0.0, position, 0.0], [rotation; 3]);
            let words = refused.unwrap_err().to_string();
            assert!(needles.iter().all(|n| words.contains(n)), "{words}");
        }
        assert_eq!(scene, before);
        scene.place(0, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]).unwrap();
        assert_eq!(scene.object[0].position_mm, [1.0, 2.0, 3.0]);
        assert_eq!(scene.object[0].rotation_deg, [4.0, 5.0, 6.0]);
        let mut empty = Scene::parse("name = \"s\"\ndescription = \"\"\n", "test").unwrap();
        let words = empty.place(0, [0.0; 3], [0.0; 3]).unwrap_err().to_string();
        assert!(words.contains("the scene is empty"), "{words}");
    }

    #[test]
    fn every_built_in_scene_can_be_set_and_keeps_the_rest() {
        for (name, _) in crate::builtin::SCENES {
            let before = Scene::load(name).unwrap();
            let mut scene = before.clone();
            scene
                .set("ambient.irradiance_w_m2=0.125".parse().unwrap())
                .unwrap();
            assert_eq!(scene.ambient.irradiance_w_m2, 0.125, "{name}");
            scene.ambient = before.ambient;
            assert_eq!(scene, before, "{name}");
        }
    }

    #[test]
    fn refused_setting_names_the_field_and_changes_nothing() {
        let mut scene = Scene::parse(TEXT, "test").unwrap();
        let before = scene.clone();
        for (text, needle) in [
            ("camera.width_px=9", "a field of the profile"),
            ("rig.position_mm=[0,0,1]", "the device's own"),
            ("object[0].albedo=7", "albedo"),
            ("object[0].colour=7", "colour"),
            ("object[9].albedo=0.5", "object"),
            ("moon=1", "moon"),
        ] {
            let words = scene.set(text.parse().unwrap()).unwrap_err().to_string();
            assert!(words.contains(needle), "{text}: {words}");
        }
        assert_eq!(scene, before);
        scene.set("object[0].albedo=0.25".parse().unwrap()).unwrap();
        assert_eq!(scene.object[0].albedo, 0.25);
    }
}
