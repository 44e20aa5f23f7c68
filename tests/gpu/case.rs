//! Scenes and profiles that each need one term and are small enough for a software Vulkan device.

use phasmid::emulator::led::{Model, Source};
use phasmid::emulator::render::{Backend, Options, Renderer};
use phasmid::emulator::{PatternImage, Shot, Showing, Shutter};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Droop, Led, Profile, Scene};
use std::path::Path;
use std::sync::Arc;

/// Number of columns and rows of the camera.
const SIZE: [u32; 2] = [400, 240];

/// A profile, a scene, and the patterns to expose.
#[derive(Clone)]
pub struct Case {
    /// Name of the case, for messages and for the folder in which the images of a failure are kept.
    pub name: &'static str,
    pub profile: Profile,
    pub scene: Scene,
    pub options: Options,
    pub shots: Vec<Shot>,
}

impl Case {
    /// Returns a case with the centre of the bench of Wu et al. in front of a scene, which is built
    /// in or given by a few lines of TOML. It exposes a fringe and white.
    pub fn new(name: &'static str, scene: &str) -> Self {
        Self::with(name, "pmp-bench", scene, Path::new("."), |_| {})
    }

    /// Same as [`Self::new`], with a modified profile and with files in a folder.
    pub fn with(
        name: &'static str,
        profile: &str,
        scene: &str,
        folder: &Path,
        change: impl FnOnce(&mut Profile),
    ) -> Self {
        let mut profile = Profile::load(profile).unwrap();
        let camera = &mut profile.camera;
        camera.sensor_width_mm *= f64::from(SIZE[0]) / f64::from(camera.width_px);
        (camera.width_px, camera.height_px) = (SIZE[0], SIZE[1]);
        change(&mut profile);
        let mut scene = match Scene::load(scene) {
            Ok(scene) => scene,
            Err(_) => {
                let text = format!("name = \"{name}\"\ndescription = \"\"\n{scene}");
                Scene::parse(&text, name).unwrap()
            }
        };
        scene.folder = folder.to_path_buf();
        let mut case = Self {
            name,
            profile,
            scene,
            // Only the CPU interpolates the geometry of moving scenes.
            options: Options {
                motion_tolerance_px: 0.0,
                ..Options::default()
            },
            shots: Vec::new(),
        };
        let fringe = Pattern::Fringe {
            axis: Axis::X,
            period_px: 16.0,
            phase_rad: 0.4,
        };
        case.shoot(&[fringe, Pattern::White {}]);
        case
    }

    /// Sets the patterns to expose, one after the other.
    pub fn shoot(&mut self, patterns: &[Pattern]) {
        let pattern_images: Vec<_> = patterns.iter().map(|p| self.pattern_image(p)).collect();
        self.shots = pattern_images
            .iter()
            .zip(0..)
            .map(|(s, i)| self.shot(s, i))
            .collect();
    }

    /// Also exposes a two-dimensional pattern: slanted bars with smooth flanks.
    pub fn shoot_image(&mut self) {
        let projector = &self.profile.projector;
        let (width, height) = (projector.width_px, projector.height_px);
        let level = |i: u32| {
            let (x, y) = (f64::from(i % width), f64::from(i / width));
            (127.5 + 127.5 * ((x + 0.6 * y) / 5.0).sin()).round() as u16
        };
        let pattern_image = Arc::new(PatternImage::Image {
            width,
            height,
            levels: (0..width * height).map(level).collect(),
        });
        let shot = self.shot(&pattern_image, self.shots.len() as u64);
        self.shots.push(shot);
    }

    pub fn pattern_image(&self, pattern: &Pattern) -> Arc<PatternImage> {
        Arc::new(PatternImage::new(pattern, &self.profile.projector, &|_| unreachable!()).unwrap())
    }

    fn shot(&self, pattern_image: &Arc<PatternImage>, i: u64) -> Shot {
        Shot {
            id: i,
            noise_id: i,
            pattern_image: Some(pattern_image.clone()),
            light: 1.0,
            start_ns: 3_000_000 + i * 10_000_000,
            exposure_ns: 8_000_000,
            ..Shot::default()
        }
    }

    /// Enables a rolling shutter, so that the next pattern image leaks into the lower rows.
    pub fn roll(&mut self, line_time_us: f64) {
        self.profile.camera.line_time_us = line_time_us;
        let pattern_images: Vec<_> = self
            .shots
            .iter()
            .map(|shot| shot.pattern_image.clone())
            .collect();
        for (i, shot) in self.shots.iter_mut().enumerate() {
            shot.shutter = Shutter {
                line_time_ns: (line_time_us * 1e3) as u64,
                first_row: 0,
                rows: SIZE[1],
            };
            shot.then = vec![
                Showing {
                    from_ns: shot.start_ns + shot.exposure_ns + 100_000,
                    pattern_image: pattern_images[(i + 1) % pattern_images.len()].clone(),
                    light: 0.7,
                },
                Showing {
                    from_ns: shot.start_ns + shot.exposure_ns + 1_500_000,
                    pattern_image: None,
                    light: 1.0,
                },
            ];
        }
    }

    /// Enables pattern timing with a finite rise time. The period begins before the exposure, which
    /// sees darkness, the pattern, darkness, and the start of the next pattern.
    pub fn time(&mut self) {
        let droop = Droop {
            time_constant_s: 0.02,
            fraction: 0.3,
        };
        let led = Led {
            rise_us: 900.0,
            droop: vec![droop],
        };
        let mut source = Source::new(Model::new(&led));
        self.profile.projector.led = Some(led);
        let pattern_images: Vec<_> = self
            .shots
            .iter()
            .map(|shot| shot.pattern_image.clone())
            .collect();
        for (i, shot) in self.shots.iter_mut().enumerate() {
            let show = |after_us: u64, pattern_image| Showing {
                from_ns: shot.start_ns + 1000 * after_us,
                pattern_image,
                light: 1.0,
            };
            let next = pattern_images[(i + 1) % pattern_images.len()].clone();
            shot.then = vec![
                show(300, shot.pattern_image.take()),
                show(5_000, None),
                show(6_500, next),
            ];
            source.drive(shot.start_ns + 200_000, 1.0);
            source.drive(shot.start_ns + 7_000_000, 0.4);
            shot.emission = Some(source.emission(shot.start_ns));
        }
    }

    pub fn renderer(&self, backend: Backend) -> Renderer {
        let options = Options {
            backend,
            ..self.options
        };
        let renderer = Renderer::with_options(&self.profile, &self.scene, 11, options);
        renderer.unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }
}
