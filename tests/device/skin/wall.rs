//! A flat piece of skin in front of a scanner, and its expected frames, which are computed from the
//! geometry by finite differences.

use glam::{DVec2, DVec3};
use phasmid::emulator::render::Renderer;
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::geometry::View;
use phasmid::pattern::Pattern;
use phasmid::profile::{Profile, Scene};
use std::sync::Arc;

pub fn bench() -> Profile {
    Profile::load("pmp-bench").unwrap()
}

/// Returns a scene with a plane through z = 1000 mm; `lines` are additional fields of the plane.
pub fn wall(rotation_deg: [f64; 3], lines: &str) -> Scene {
    let text = format!(
        "name = \"wall\"\ndescription = \"\"\nambient = {{ irradiance_w_m2 = 0.05 }}\n[[object]]\n\
         position_mm = [150, 0, 1000]\nrotation_deg = {rotation_deg:?}\n{lines}\n"
    );
    Scene::parse(&text, "wall").unwrap()
}

pub const PLANE: &str = "shape = { kind = \"plane\" }\nalbedo = 0.9\n";

pub fn pattern_image(pattern: &Pattern, profile: &Profile) -> Arc<PatternImage> {
    Arc::new(PatternImage::new(pattern, &profile.projector, &|_| unreachable!()).unwrap())
}

pub fn shot(pattern_image: &Arc<PatternImage>) -> Shot {
    Shot {
        id: 1,
        noise_id: 1,
        pattern_image: Some(pattern_image.clone()),
        light: 0.5,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

/// Returns the level of a pattern image at each pixel, 0 to 1 of full white; NaN for pixels that are
/// dark under full white.
pub fn levels(
    renderer: &mut Renderer,
    profile: &Profile,
    pattern_image: &Arc<PatternImage>,
) -> Vec<f64> {
    let [black, white] = [Pattern::Black {}, Pattern::White {}]
        .map(|pattern| renderer.expected_dn(&shot(&self::pattern_image(&pattern, profile))));
    let seen = renderer.expected_dn(&shot(pattern_image));
    (0..seen.len())
        .map(|i| f64::from(seen[i] - black[i]) / f64::from(white[i] - black[i]))
        .collect()
}

pub fn is_even(truth: &Truth, i: usize) -> bool {
    truth.flags[i] & (Truth::LIT | Truth::CREASE) == Truth::LIT
}

/// Geometry of the point of a flat wall that a pixel sees, in f64 and by central differences.
pub struct Seen {
    /// Column of the pattern image that lights the point.
    pub x: f64,
    /// Derivatives of `x` with respect to the camera's pixel coordinates.
    pub slope: DVec2,
    /// Gradient of `x` along the wall in 1/mm.
    pub gradient: DVec3,
    /// Component along the wall of the light's unit direction.
    pub along: DVec3,
    /// Depth in the projector's frame in millimetres.
    pub depth: f64,
    pub point: DVec3,
}

impl Seen {
    /// Computes the geometry for the pixel at `px`; `normal` is the normal of the wall.
    pub fn new(profile: &Profile, normal: DVec3, px: DVec2) -> Self {
        let (camera, projector) = (profile.camera.view(), profile.projector.view());
        let middle = DVec3::new(150.0, 0.0, 1000.0);
        let hit = |px: DVec2| {
            let ray = camera.ray(px);
            ray * (normal.dot(middle) / normal.dot(ray))
        };
        let column = |p: DVec3| projected(&projector, p).x;
        let point = hit(px);
        let by_pixel =
            |step: DVec2| (column(hit(px + step * 1e-3)) - column(hit(px - step * 1e-3))) / 2e-3;
        let e1 = normal.any_orthonormal_vector();
        let gradient = [e1, normal.cross(e1)]
            .map(|e| e * (column(point + e * 1e-2) - column(point - e * 1e-2)) / 2e-2);
        let way = (point - projector.center()).normalize();
        Self {
            x: column(point),
            slope: DVec2::new(by_pixel(DVec2::X), by_pixel(DVec2::Y)),
            gradient: gradient[0] + gradient[1],
            along: way - normal * normal.dot(way),
            depth: projector.rig_from_view.inverse().point(point).z,
            point,
        }
    }
}

fn projected(view: &View, point: DVec3) -> DVec2 {
    view.project(point).unwrap()
}
