//! Planes and spheres with the dimensions of the bench, and larger, nearer and more oblique ones.

use super::closed_form::{Plane, Sphere};
use super::hold::{bench, hold};
use glam::DVec3;
use phasmid::profile::Profile;

fn distorted() -> Profile {
    let mut profile = bench();
    profile.camera.distortion = [-0.12, 0.05, 8e-4, -5e-4, -0.004];
    profile.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.001];
    profile
}

/// Returns a profile whose projector has the largest number of pixels that a manifest allows.
fn wide() -> Profile {
    let mut profile = bench();
    let factor = 32768.0 / f64::from(profile.projector.width_px);
    profile.projector.width_px = 32768;
    profile.projector.height_px = 18432;
    profile.projector.lens_shift_px[0] *= factor;
    profile
}

pub fn plane(tilt_deg: f64, z_mm: f64) -> Plane {
    Plane { tilt_deg, z_mm }
}

#[test]
fn planes_of_any_tilt_are_exact() {
    for profile in [bench(), distorted(), wide()] {
        for tilt_deg in [0.0, 35.0, -60.0] {
            let held = hold(&profile, &plane(tilt_deg, 1000.0));
            assert!(held > 20_000, "{tilt_deg}: {held} pixels");
        }
    }
}

#[test]
fn planes_seen_almost_edge_on_are_exact() {
    let mut profile = bench();
    profile.projector.throw_ratio = 0.5;
    for tilt_deg in [89.0, 89.9, -89.9] {
        let held = hold(&profile, &plane(tilt_deg, 1000.0));
        assert!(held > 1000, "{tilt_deg}: {held} pixels");
    }
}

#[test]
fn spheres_are_exact() {
    for profile in [bench(), distorted(), wide()] {
        for (center_mm, radius_mm) in [
            (DVec3::new(30.0, -10.0, 1000.0), 120.0),
            (DVec3::new(-50.0, 40.0, 900.0), 8.0),
            (DVec3::new(0.0, 0.0, 1e5), 99_000.0),
        ] {
            let held = hold(
                &profile,
                &Sphere {
                    center_mm,
                    radius_mm,
                },
            );
            assert!(held > 50, "{radius_mm}: {held} pixels");
        }
    }
}
