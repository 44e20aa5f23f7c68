//! Ground truth of frames, and the resolution limit of fringes.

use super::Renderer;
use super::time::middle_ns;
use crate::scene::{Surface, World};
use crate::schedule::Light;
use crate::shot::Shot;
use crate::transport::Patch;
use crate::truth::Truth;
use crate::{Term, truth};
use glam::DVec3;
use phasmid_pattern::{Axis, Pattern, finest_fringe};
use rayon::prelude::*;
use std::f64::consts::PI;

impl Renderer {
    /// Returns the ground truth of a sequence's frames: geometry, and the mean and modulation of the
    /// sequence's finest fringes before noise and rounding. A moving scene is evaluated midway
    /// between the start of the first exposure and the end of the last one.
    pub fn truth(&mut self, sequence: &[(Pattern, Shot)]) -> Truth {
        let middle = middle_ns(sequence.iter().map(|(_, shot)| shot));
        self.truth_at(sequence, middle)
    }

    /// Same as [`Self::truth`] at a device time in nanoseconds, with the scene frozen in its state
    /// at that time.
    pub fn truth_at(&mut self, sequence: &[(Pattern, Shot)], time_ns: u64) -> Truth {
        self.expect_pattern_images(
            sequence
                .iter()
                .filter_map(|(_, s)| s.pattern_image.as_deref()),
        );
        self.go_to_time(time_ns);
        self.prepare();
        let fringes = finest_fringes(sequence);
        let signals: Vec<_> = fringes
            .iter()
            .map(|(_, shot)| {
                let light = Light::Scheduled(self.schedule(shot));
                self.expected(shot, light)
            })
            .collect();
        let phases: Vec<_> = fringes.iter().map(|(phase, _)| *phase).collect();
        let mut flags = self.flags(sequence);
        for ((_, shot), signal) in fringes.iter().zip(&signals) {
            let exposure_s = shot.exposure_ns as f64 * 1e-9;
            let sensor = &self.profile.camera.sensor;
            let full = sensor.noise_model(shot.gain_db, exposure_s).saturation_dn;
            truth::flag_saturated(&mut flags, signal, full);
        }
        let map = &self.buffer;
        let (mean_dn, modulation_dn) = truth::harmonic(&phases, &signals, map.x.len());
        let noise = fringes.first().map(|(_, shot)| {
            let exposure_s = shot.exposure_ns as f64 * 1e-9;
            let sensor = &self.profile.camera.sensor;
            sensor.noise_model(shot.gain_db, exposure_s)
        });
        let noise_dn = |dn: &f32| match &noise {
            Some(noise) if dn.is_finite() => noise.variance_dn2(f64::from(*dn)).sqrt() as f32,
            _ => f32::NAN,
        };
        let places = self.places();
        let of = |value: fn(&PlaceOfPixel) -> f32| places.iter().map(value).collect();
        Truth {
            width: map.width as u32,
            height: map.height as u32,
            depth_mm: map.depth.clone(),
            projector_x: map.x.clone(),
            projector_y: map.y.clone(),
            point_mm: places.iter().map(|place| place.point_mm).collect(),
            normal: places.iter().map(|place| place.normal).collect(),
            object: places.iter().map(|place| place.object).collect(),
            albedo: of(|place| place.albedo),
            irradiance_w_m2: of(|place| place.irradiance_w_m2),
            noise_dn: mean_dn.iter().map(noise_dn).collect(),
            mean_dn,
            modulation_dn,
            flags,
        }
    }

    /// Returns a description of the surface that each pixel sees.
    fn places(&self) -> Vec<PlaceOfPixel> {
        let (width, height) = (self.buffer.width, self.buffer.height);
        let of_row = |row| {
            let world = self.worlds.at(row);
            let places = (0..width).map(|column| self.place_of(&world, column, row));
            places.collect::<Vec<_>>()
        };
        (0..height).into_par_iter().flat_map_iter(of_row).collect()
    }

    /// Returns a description of the surface that a pixel's centre sees.
    fn place_of(&self, world: &World, column: usize, row: usize) -> PlaceOfPixel {
        let map = &self.buffer;
        let pixel = row * map.width + column;
        if map.flags[pixel] & Truth::SEEN == 0 {
            return PlaceOfPixel::NONE;
        }
        let surface = Surface(map.surface[pixel]);
        let rays = self.pixel_rays();
        let direction = rays.center(column, row);
        let depth = f64::from(map.depth[pixel]);
        let point = direction * depth;
        let normal = DVec3::from_array(map.normal[pixel].map(f64::from));
        // Sides of the pixel's footprint on the tangent plane.
        let (slope, facing) = (rays.slope(direction), normal.dot(direction));
        let sides = [slope.x_axis, slope.y_axis].map(|slope| {
            let step = slope.extend(0.0) * depth;
            step - direction * (normal.dot(step) / facing)
        });
        let patch = Patch {
            point,
            normal,
            surface,
            sides,
        };
        let optics = &self.optics;
        let irradiance_w_m2 = match map.flags[pixel] & Truth::LIT {
            0 => 0.0,
            _ => {
                let to_light = optics.projector.center() - point;
                let cos = normal.dot(to_light.normalize()).max(0.0);
                let view = &optics.projector.rig_from_view;
                let local = view.rotation.transpose() * (point - view.translation_mm);
                let ideal = local.truncate() / local.z;
                let shown = match self.plan.has(Term::ProjectorVignetting) {
                    true => optics.shown.at(ideal),
                    false => 1.0,
                };
                shown * optics.irradiance_w_m2(cos, to_light.length_squared())
            }
        };
        let materials = &world.materials;
        PlaceOfPixel {
            point_mm: point.to_array().map(|x| x as f32),
            normal: map.normal[pixel],
            object: world.object(surface),
            albedo: materials.evenly(&self.plan, world, &patch).albedo() as f32,
            irradiance_w_m2: irradiance_w_m2 as f32,
        }
    }

    /// Returns the flags of the geometry maps, and also flags the pixels at which the sequence's
    /// finest fringes are not resolved.
    fn flags(&self, sequence: &[(Pattern, Shot)]) -> Vec<u8> {
        let map = &self.buffer;
        let mut flags = map.flags.clone();
        if self.plan.has(Term::Motion) {
            for (flags, &surface) in flags.iter_mut().zip(&map.surface) {
                if *flags & Truth::SEEN != 0 && self.worlds.any().moving(Surface(surface)) {
                    *flags |= Truth::MOVING;
                }
            }
        }
        let Some((axis, period)) = finest_fringe(sequence.iter().map(|(pattern, _)| pattern))
        else {
            return flags;
        };
        let slope = match axis {
            Axis::X => &map.x_slope,
            Axis::Y => &map.y_slope,
        };
        let lit = |flags: u8| flags & Truth::LIT != 0;
        for (i, flags) in flags.iter_mut().enumerate().filter(|(_, f)| lit(**f)) {
            let blur = map.blur_along(map.blur.get(i).copied().unwrap_or(0.0))[axis as usize];
            let skin = map.skin.as_ref();
            let under = skin.map_or(1.0, |skin| skin.contrast(i, axis as usize, period));
            let resolved = slope
                .get(i)
                .is_none_or(|slope| is_resolved(*slope, blur, under, period));
            if !resolved {
                *flags |= Truth::UNRESOLVED;
            }
        }
        flags
    }
}

/// Description of the surface that a pixel's centre sees; NaN if there is none.
struct PlaceOfPixel {
    point_mm: [f32; 3],
    normal: [f32; 3],
    object: u16,
    albedo: f32,
    irradiance_w_m2: f32,
}

impl PlaceOfPixel {
    const NONE: Self = Self {
        point_mm: [f32::NAN; 3],
        normal: [f32::NAN; 3],
        object: Truth::NO_OBJECT,
        albedo: f32::NAN,
        irradiance_w_m2: f32::NAN,
    };
}

/// Returns the phases and shots of the finest fringes.
fn finest_fringes(sequence: &[(Pattern, Shot)]) -> Vec<(f64, &Shot)> {
    let finest = finest_fringe(sequence.iter().map(|(pattern, _)| pattern));
    sequence
        .iter()
        .filter_map(|(pattern, shot)| match *pattern {
            Pattern::Fringe {
                axis,
                period_px,
                phase_rad,
            } if finest == Some((axis, period_px)) => Some((phase_rad, shot)),
            _ => None,
        })
        .collect()
}

/// Minimum contrast that a resolved fringe keeps, relative to its full contrast.
const LEAST: f64 = 0.05;

/// Returns whether a fringe of `period` projector pixels is resolved. The footprint has the
/// derivatives `slope`, the blur has the standard deviation `sigma` in projector pixels, and skin
/// leaves the fraction `under` of the contrast.
///
/// The two boxes of the footprint attenuate the contrast by sinc(a/P) sinc(b/P), which is 0 if a box
/// is one period wide and negative if it is wider. The blur attenuates it by exp(-2 pi^2 sigma^2 /
/// P^2).
fn is_resolved(slope: [f32; 2], sigma: f32, under: f64, period: f64) -> bool {
    let [a, b] = slope.map(|s| f64::from(s.abs()) / period);
    let sigma = f64::from(sigma) / period;
    let sinc = |w: f64| {
        if w > 0.0 {
            (PI * w).sin() / (PI * w)
        } else {
            1.0
        }
    };
    let left = under * sinc(a) * sinc(b) * (-2.0 * (PI * sigma).powi(2)).exp();
    a < 1.0 && b < 1.0 && left >= LEAST
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::{Profile, Scene};

    const SCENE: &str = "name = \"s\"\ndescription = \"\"\n\
    [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0.0, 0.0, 1000.0]\nalbedo = 0.25\n\
    [[object]]\nshape = { kind = \"sphere\", radius_mm = 60.0 }\n\
    position_mm = [0.0, 0.0, 900.0]\nalbedo = 0.75\n";

    #[test]
    fn surface_maps_agree_with_the_scene_and_its_light() {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::parse(SCENE, "test").unwrap();
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let truth = renderer.truth(&[]);
        let center = scene.rig_from_object(&scene.object[1]).translation_mm;
        let mut pixels = [0; 2];
        for at in (0..truth.flags.len()).filter(|&at| truth.flags[at] & Truth::SEEN != 0) {
            let object = usize::from(truth.object[at]);
            pixels[object] += 1;
            let [point, normal] =
                [truth.point_mm[at], truth.normal[at]].map(|v| DVec3::from_array(v.map(f64::from)));
            assert_eq!(truth.point_mm[at][2], truth.depth_mm[at]);
            assert!((normal.length() - 1.0).abs() < 1e-6 && normal.dot(point) < 0.0);
            if object == 1 {
                assert!(((point - center).length() - 60.0).abs() < 1e-3, "{point}");
                assert!((normal - (point - center) / 60.0).length() < 1e-4);
            }
            assert_eq!(truth.albedo[at], [0.25, 0.75][object]);
            // Electrons from the light that the surface reflects towards the sensor.
            let electrons = renderer.optics.electrons_per_irradiance
                * f64::from(truth.albedo[at] * truth.irradiance_w_m2[at]);
            let rendered = f64::from(renderer.buffer.projected[at]);
            assert!(
                (electrons - rendered).abs() <= 1e-4 * rendered.max(1.0),
                "{at}"
            );
        }
        assert!(pixels[0] > 100_000 && pixels[1] > 5000, "{pixels:?}");
        assert!(truth.noise_dn.iter().all(|dn| dn.is_nan()), "no fringes");
    }

    #[test]
    fn fringes_down_to_one_period_a_pixel_are_resolved() {
        assert!(is_resolved([4.35, 0.0], 0.0, 1.0, 16.0));
        assert!(is_resolved([-7.6, 0.0], 0.0, 1.0, 16.0), "2.1 px a period");
        assert!(
            !is_resolved([16.0, 0.0], 0.0, 1.0, 16.0) && !is_resolved([0.0, 22.9], 0.0, 1.0, 16.0)
        );
        assert!(
            !is_resolved([0.0, 40.0], 0.0, 1.0, 16.0),
            "contrast is back, upright"
        );
        // The contrast is exp(-2 pi^2 (6.24/16)^2) = 0.0497, just below the minimum.
        assert!(
            is_resolved([0.1, 0.0], 6.2, 1.0, 16.0) && !is_resolved([0.1, 0.0], 6.24, 1.0, 16.0)
        );
        assert!(is_resolved([0.1, 0.0], 0.0, 0.051, 16.0));
        assert!(!is_resolved([0.1, 0.0], 0.0, 0.049, 16.0));
        assert!(!is_resolved([f32::NAN, 0.0], 0.0, 1.0, 16.0));
    }
}
