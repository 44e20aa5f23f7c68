//! Changing the scene at run time.

use super::Renderer;
use crate::exposure::Optics;
use crate::plan::Needs;
use crate::scene::{World, Worlds};
use crate::{Backend, Plan, Term, gpu};
use phasmid_core::error::{Error, Result};
use phasmid_profile::Scene;

impl Renderer {
    /// Moves an object to another pose, with the same effect as setting the pose in the scene file:
    /// position in millimetres, rotation in degrees. `object` counts from 0 in the order of the
    /// scene. Pending frames must be finished before the call.
    ///
    /// # Errors
    /// Returns an error if [`phasmid_profile::Scene::place`] fails, or an error of [`Self::change`].
    pub fn place(
        &mut self,
        object: usize,
        position_mm: [f64; 3],
        rotation_deg: [f64; 3],
    ) -> Result<()> {
        let mut scene = self.scene.clone();
        scene.place(object, position_mm, rotation_deg)?;
        self.change(scene)
    }

    /// Renders another scene from now on. The plan is rebuilt, but forced terms stay forced. Pending
    /// frames must be finished before the call. A working GPU stays open.
    ///
    /// # Errors
    /// Returns an error if a mesh or texture file cannot be read, or if an explicitly requested GPU
    /// cannot hold the scene. In these cases nothing is changed.
    pub fn change(&mut self, scene: Scene) -> Result<()> {
        let moved_only = without_poses(&scene) == without_poses(&self.scene);
        let optics = (!moved_only).then(|| Optics::new(&self.profile, &scene));
        let new = optics.as_ref().unwrap_or(&self.optics);
        let world = World::new(&scene, &new.skins)?;
        let fits = match &self.gpu {
            Some(_) => gpu::fits(&world, new),
            None => Ok(()),
        };
        if let (Err(why), Backend::Gpu) = (&fits, self.options.backend) {
            return Err(Error::input(
                "scene",
                why,
                "a scene that the GPU can render",
            ));
        }
        let mut plan = Plan::new(&Needs {
            profile: &self.profile,
            optics: new,
            world: &world,
        });
        // Keep the terms that the patterns need.
        for term in [Term::FootprintX, Term::FootprintY] {
            plan.set(term, plan.has(term) || self.plan.has(term));
        }
        for (term, included) in &self.forced {
            plan.set(*term, *included);
        }
        if let Err(why) = fits {
            self.give_up(&Error::device(why));
        }
        self.scene = scene;
        let stop = self.worlds.stop.clone();
        self.worlds = Worlds::new(world);
        self.worlds.stop = stop;
        self.moment = None;
        if let Some(optics) = optics {
            self.optics = optics;
            self.go_by(plan);
            self.choose_gathering();
        } else if plan == self.plan {
            self.outdate();
        } else {
            self.go_by(plan);
        }
        if let Some(gpu) = &mut self.gpu {
            gpu.forget();
        }
        Ok(())
    }
}

/// Returns a scene with all objects at the scene's origin.
fn without_poses(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for object in &mut scene.object {
        (object.position_mm, object.rotation_deg) = ([0.0; 3], [0.0; 3]);
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Options;
    use crate::{pattern_image::PatternImage, shot::Shot};
    use phasmid_pattern::{Axis, Pattern};
    use phasmid_profile::{Profile, Scene};
    use std::sync::Arc;

    const SCENE: &str = "name = \"s\"\ndescription = \"\"\n\
        [ambient]\nirradiance_w_m2 = 0.02\n\
        [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0.0, 0.0, 1000.0]\nalbedo = 0.6\n";
    const SPHERE: &str = "[[object]]\nshape = { kind = \"sphere\", radius_mm = 60.0 }\n\
        position_mm = [0.0, 0.0, 900.0]\nalbedo = 0.8\n";
    const TORSO: &str = "[[object]]\nshape = { kind = \"torso\", triangles = 2000 }\n\
        position_mm = [0.0, 0.0, 950.0]\nalbedo = 0.7\n";

    fn shot(noise_id: u64) -> Shot {
        let row = (0..854).map(|x| (x % 16 * 16) as u16).collect();
        Shot {
            noise_id,
            pattern_image: Some(Arc::new(PatternImage::Row(Axis::X, row))),
            light: 1.0,
            exposure_ns: 8_000_000,
            ..Shot::default()
        }
    }

    fn renderer(scene: &Scene, backend: Backend) -> Renderer {
        let profile = Profile::load("webcam-grey").unwrap();
        let options = Options {
            backend,
            ..Options::default()
        };
        Renderer::with_options(&profile, scene, 3, options).unwrap()
    }

    /// Checks that frames after an object is placed equal the frames of a device that started with
    /// that placement.
    fn frames_equal(text: &str, object: usize, backend: Backend) {
        let mut scene = Scene::parse(text, "test").unwrap();
        let mut placed = renderer(&scene, backend);
        let before = placed.expose(&shot(0));
        let (position, rotation) = ([15.0, -8.0, 870.0], [4.0, 21.0, -30.0]);
        placed.place(object, position, rotation).unwrap();
        scene.place(object, position, rotation).unwrap();
        let mut started = renderer(&scene, backend);
        for id in [1, 0, 2] {
            assert_eq!(placed.expose(&shot(id)), started.expose(&shot(id)));
        }
        assert_ne!(placed.expose(&shot(0)), before);
    }

    #[test]
    fn placed_object_renders_like_scene_with_that_position() {
        for (text, object) in [
            (SCENE.to_owned(), 0),
            (format!("{SCENE}{SPHERE}"), 1),
            (format!("{SCENE}{TORSO}"), 0),
            (format!("{SCENE}{TORSO}"), 1),
        ] {
            frames_equal(&text, object, Backend::Cpu);
        }
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn placed_object_renders_alike_on_the_gpu() {
        for (text, object) in [
            (SCENE.to_owned(), 0),
            (format!("{SCENE}{SPHERE}"), 1),
            (format!("{SCENE}{TORSO}"), 1),
        ] {
            frames_equal(&text, object, Backend::Gpu);
        }
    }

    #[test]
    fn truth_follows_a_plane_moved_by_100_mm() {
        let scene = Scene::parse(SCENE, "test").unwrap();
        let mut renderer = renderer(&scene, Backend::Cpu);
        let sequence = [(Pattern::White {}, shot(0))];
        let depth = |renderer: &mut Renderer| renderer.truth(&sequence).depth_mm;
        assert!(depth(&mut renderer).iter().all(|z| *z == 1000.0));
        renderer.place(0, [0.0, 0.0, 900.0], [0.0; 3]).unwrap();
        assert!(depth(&mut renderer).iter().all(|z| *z == 900.0));
        // A refused placement leaves the object unchanged.
        assert!(renderer.place(1, [0.0; 3], [0.0; 3]).is_err());
        assert!(depth(&mut renderer).iter().all(|z| *z == 900.0));
    }

    #[test]
    fn plan_is_updated_after_placement() {
        let text = format!("{SCENE}{SPHERE}").replace(
            "shape = { kind = \"plane\" }",
            "shape = { kind = \"plane\", size_mm = [1.0, 1.0] }",
        );
        let mut renderer = renderer(&Scene::parse(&text, "test").unwrap(), Backend::Cpu);
        renderer.expose(&shot(0));
        renderer.force(Term::Noise, false);
        renderer.place(1, [0.0, 0.0, 0.0], [0.0; 3]).unwrap();
        assert!(renderer.plan().has(Term::Shadows) && renderer.plan().has(Term::FootprintX));
        assert!(
            !renderer.plan().has(Term::Noise),
            "forced terms stay forced"
        );
    }

    /// Checks that frames after any change equal the frames of a device that started with the
    /// changed scene.
    fn changed_frames_equal(backend: Backend) {
        let lamp = "[[light]]\nkind = \"point\"\nposition_mm = [300.0, 0.0, 0.0]\n\
            intensity_w_sr = 0.02\n";
        let scenes = [
            format!("{SCENE}{SPHERE}"),
            format!("{SCENE}{SPHERE}").replace("albedo = 0.8", "albedo = 0.3"),
            format!("{SCENE}{SPHERE}").replace("0.02", "0.05"),
            format!("{SCENE}{TORSO}{lamp}"),
            SCENE.to_owned(),
        ];
        let scenes = scenes.map(|text| Scene::parse(&text, "test").unwrap());
        let mut changed = renderer(&scenes[0], backend);
        for scene in &scenes {
            changed.change(scene.clone()).unwrap();
            let mut started = renderer(scene, backend);
            for id in [0, 3] {
                assert_eq!(changed.expose(&shot(id)), started.expose(&shot(id)));
            }
        }
    }

    #[test]
    fn changed_scene_renders_like_a_new_one() {
        changed_frames_equal(Backend::Cpu);
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn changed_scene_renders_alike_on_the_gpu() {
        changed_frames_equal(Backend::Gpu);
    }
}
