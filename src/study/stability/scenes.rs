//! Rendered scenes: far from the origin, near and far, edge-on; the fast path in f32 and the
//! reference path in f64 against closed forms.

use super::case::{Case, Group, Sweep, worse};
use super::rays::{EPS, EPS_F32};
use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_profile::{Profile, Scene};
use phasmid_render::Renderer;
use phasmid_render::reference::Reference;
use phasmid_render::truth::Truth;

pub(super) const WIDTH: u32 = 64;
pub(super) const HEIGHT: u32 = 48;
/// Number of f64 roundings between a ray and a projector pixel, estimated generously.
const ROUNDINGS: f64 = 16.0;
/// Number of f32 roundings of the values that the geometry pass stores; before they are stored, hits are
/// recomputed in f64.
pub(super) const KEPT: f64 = 2.0;

pub(super) const GROUP: Group = Group {
    title: "Scenes",
    sweeps: &[
        Sweep {
            key: "origin",
            title: "A rig and a plane at 1000 mm, both farther and farther from the scene's \
                origin: the fast path",
            oracle: "The projector pixel of each camera pixel in closed form. Allowed: 2 roundings of f32 \
                near the camera and 16 of f64 in the scene's coordinates",
            ratio: "offset over distance",
            error: "worst error in projector px",
            rounding: false,
            cases: |_| origin(false),
        },
        Sweep {
            key: "origin-reference",
            title: "A rig and a plane farther and farther from the scene's origin: the reference \
                path",
            oracle: "Allowed: 16 roundings of f64 in the scene's coordinates",
            ratio: "offset over distance",
            error: "worst error in projector px",
            rounding: true,
            cases: |_| origin(true),
        },
        Sweep {
            key: "range",
            title: "Planes from 10 mm to ten kilometres, baseline 200 mm, the fast path",
            oracle: "Depth in closed form. Allowed: 2 roundings of f32",
            ratio: "distance over baseline",
            error: "depth error over depth",
            rounding: false,
            cases: |_| range(),
        },
        Sweep {
            key: "grazing",
            title: "Planes seen almost edge-on, the fast path",
            oracle: "The projector pixel in closed form. Allowed: 2 roundings of f32 of the ray, in camera \
                pixels, times the pixel's footprint on the slide. Ratio: 1 over the cosine of the tilt",
            ratio: "1 / cos tilt",
            error: "error over footprint",
            rounding: false,
            cases: |_| grazing(),
        },
    ],
};

/// Returns a profile with a small, noiseless camera behind a wide lens.
pub(super) fn small() -> Result<Profile> {
    let mut profile = Profile::load("webcam-grey")?;
    let camera = &mut profile.camera;
    (camera.width_px, camera.height_px) = (WIDTH, HEIGHT);
    camera.sensor_width_mm = 3.6 * 0.5;
    camera.data_line = false;
    Ok(profile)
}

/// Creates a scene from the lines of its objects.
pub(super) fn scene(lines: &str) -> Result<Scene> {
    Scene::parse(
        &format!("name = \"s\"\ndescription = \"\"\n{lines}"),
        "scene.toml",
    )
}

/// A plane through (0, 0, z), rotated about y, and the profile's two lenses in closed form.
pub(super) struct Plane<'a> {
    pub(super) profile: &'a Profile,
    pub(super) z_mm: f64,
    pub(super) tilt_deg: f64,
}

impl Plane<'_> {
    fn ray(&self, px: DVec2) -> DVec3 {
        let camera = &self.profile.camera;
        let focal = camera.focal_length_mm * f64::from(WIDTH) / camera.sensor_width_mm;
        let middle = DVec2::new(f64::from(WIDTH) - 1.0, f64::from(HEIGHT) - 1.0) / 2.0;
        ((px - middle) / focal).extend(1.0)
    }

    /// Returns the depth at which a pixel's ray meets the plane.
    pub(super) fn depth(&self, px: DVec2) -> Option<f64> {
        let (sin, cos) = self.tilt_deg.to_radians().sin_cos();
        let depth = self.z_mm * cos / (self.ray(px).x * sin + cos);
        (depth > 0.0 && depth.is_finite()).then_some(depth)
    }

    /// Returns the projector pixel that lights the point seen by a pixel; `None` behind the projector.
    fn lit_from(&self, px: DVec2) -> Option<DVec2> {
        let projector = &self.profile.projector;
        let way = self.ray(px) * self.depth(px)? - DVec3::from(projector.position_mm);
        let (w, h) = (
            f64::from(projector.width_px),
            f64::from(projector.height_px),
        );
        let middle = DVec2::new(w - 1.0, h - 1.0) / 2.0 + DVec2::from(projector.lens_shift_px);
        (way.z > 0.0).then(|| way.truncate() / way.z * (projector.throw_ratio * w) + middle)
    }

    /// Returns the side of a pixel's footprint in projector pixels.
    fn footprint(&self, px: DVec2) -> Option<f64> {
        let across = |axis: DVec2| {
            let ends = [0.5, -0.5].map(|half| self.lit_from(px + axis * half));
            Some((ends[0]? - ends[1]?).length())
        };
        Some(across(DVec2::X)?.max(across(DVec2::Y)?))
    }

    /// Returns the error in projector pixels due to one rounding of the camera's ray and of the pattern
    /// image's coordinate.
    fn rounding(&self, px: DVec2) -> Option<f64> {
        let projector = &self.profile.projector;
        let focal = projector.throw_ratio * f64::from(projector.width_px);
        Some(focal + self.lit_from(px)?.length())
    }
}

pub(super) fn pixels() -> impl Iterator<Item = (usize, DVec2)> {
    (0..(WIDTH * HEIGHT) as usize).map(|i| {
        let (u, v) = (i % WIDTH as usize, i / WIDTH as usize);
        (i, DVec2::new(u as f64, v as f64))
    })
}

fn origin(reference: bool) -> Result<Vec<Case>> {
    let profile = small()?;
    let plane = Plane {
        profile: &profile,
        z_mm: 1000.0,
        tilt_deg: 20.0,
    };
    let one = |offset: f64| {
        let (sin, cos) = 33f64.to_radians().sin_cos();
        let (x, y) = (0.6 * offset, -0.5 * offset);
        let z = 0.62 * offset;
        let lines = format!(
            "[rig]\nposition_mm = [{x:?}, {y:?}, {z:?}]\nrotation_deg = [0.0, 33.0, 0.0]\n[[object]]\n\
             shape = {{ kind = \"plane\" }}\nalbedo = 0.5\nposition_mm = [{:?}, {y:?}, {:?}]\n\
             rotation_deg = [0, 53, 0]\n",
            x + 1000.0 * sin,
            z + 1000.0 * cos,
        );
        let name = format!("{offset} mm");
        let scene = match scene(&lines) {
            Ok(scene) => scene,
            Err(e) => {
                return Ok(Case::refused(
                    name,
                    offset / 1e3,
                    &e.to_string(),
                    "position_mm",
                ));
            }
        };
        let mut worst = (0.0, f64::INFINITY);
        let exact_path = reference
            .then(|| Reference::new(&profile, &scene))
            .transpose()?;
        let truth = match exact_path {
            None => Renderer::new(&profile, &scene, 1)?.truth(&[]),
            Some(_) => Truth::default(),
        };
        for (i, px) in pixels() {
            let (Some(exact), Some(near)) = (plane.lit_from(px), plane.rounding(px)) else {
                continue;
            };
            // Rounding of scene coordinates moves the point relative to the rig.
            let far = ROUNDINGS * EPS * near * (1.0 + offset / 1e3);
            let (found, allowed) = match &exact_path {
                Some(path) => (path.trace(px).map_or(DVec2::NAN, |f| f.projector_px), far),
                None => {
                    let x = f64::from(truth.projector_x[i]);
                    let y = f64::from(truth.projector_y[i]);
                    (DVec2::new(x, y), KEPT * EPS_F32 * near + far)
                }
            };
            worse(&mut worst, (found - exact).abs().max_element(), allowed);
        }
        Ok(Case::held(name, offset / 1e3, worst.0, worst.1))
    };
    [0.0, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e10]
        .into_iter()
        .map(one)
        .collect()
}

fn range() -> Result<Vec<Case>> {
    let profile = small()?;
    let one = |z_mm: f64| {
        let plane = Plane {
            profile: &profile,
            z_mm,
            tilt_deg: -25.0,
        };
        let lines = format!(
            "[[object]]\nshape = {{ kind = \"plane\" }}\nalbedo = 0.5\nposition_mm = [0, 0, {z_mm:?}]\n\
             rotation_deg = [0, -25, 0]\n"
        );
        let truth = Renderer::new(&profile, &scene(&lines)?, 1)?.truth(&[]);
        let mut worst = (0.0, f64::INFINITY);
        for (i, px) in pixels() {
            let Some(depth) = plane.depth(px) else {
                continue;
            };
            let error = (f64::from(truth.depth_mm[i]) - depth).abs() / depth;
            worse(&mut worst, error, KEPT * EPS_F32);
        }
        Ok(Case::held(
            format!("{z_mm} mm"),
            z_mm / 200.0,
            worst.0,
            worst.1,
        ))
    };
    [10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7]
        .into_iter()
        .map(one)
        .collect()
}

fn grazing() -> Result<Vec<Case>> {
    let profile = small()?;
    let one = |tilt_deg: f64| {
        let plane = Plane {
            profile: &profile,
            z_mm: 1000.0,
            tilt_deg,
        };
        let lines = format!(
            "[[object]]\nshape = {{ kind = \"plane\" }}\nalbedo = 0.5\nposition_mm = [0, 0, 1000]\n\
             rotation_deg = [0, {tilt_deg:?}, 0]\n"
        );
        let truth = Renderer::new(&profile, &scene(&lines)?, 1)?.truth(&[]);
        let camera = &profile.camera;
        let focal = camera.focal_length_mm * f64::from(WIDTH) / camera.sensor_width_mm;
        let (mut worst, mut held, mut seen_wrong) = ((0.0, f64::INFINITY), 0, 0);
        for (i, px) in pixels() {
            let seen = truth.flags[i] & Truth::SEEN != 0;
            seen_wrong += usize::from(seen != plane.depth(px).is_some());
            let known = plane
                .lit_from(px)
                .zip(plane.footprint(px))
                .zip(plane.rounding(px));
            let Some(((exact, footprint), rounding)) = known else {
                continue;
            };
            held += 1;
            let found = f64::from(truth.projector_x[i]);
            let allowed = KEPT * EPS_F32 * (rounding / footprint.max(1.0) + focal);
            let error = (found - exact.x).abs() / footprint.max(1.0);
            worse(&mut worst, error, allowed);
        }
        let name = format!("{tilt_deg} degrees");
        let ratio = 1.0 / tilt_deg.to_radians().cos();
        if seen_wrong > 0 {
            let says = format!("{seen_wrong} pixels on the wrong side of the horizon");
            return Ok(Case::failed(name, ratio, &says));
        }
        let least = 0.2;
        let share = f64::from(held) / f64::from(WIDTH * HEIGHT);
        Ok(Case::held(name, ratio, worst.0, worst.1).kept(share, least))
    };
    [0.0, 60.0, 80.0, 89.0, 89.9, 89.99, 89.999]
        .into_iter()
        .map(one)
        .collect()
}
