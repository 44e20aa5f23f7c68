//! Lenses whose distortion folds the image over, and the accuracy of the inverse distortion up to
//! the fold.

use super::case::{Case, Group, Sweep, worse};
use super::rays::EPS;
use glam::DVec2;
use phasmid_geometry::{Lens, Rig};
use phasmid_profile::Profile;

pub(super) const GROUP: Group = Group {
    title: "Distortion",
    sweeps: &[
        Sweep {
            key: "fold",
            title: "Towards the fold of a barrel lens (k1 = -0.3), where its image turns back",
            oracle: "Ideal points are chosen, distorted in closed form and undistorted. Allowed: 8 \
                roundings of the distortion's terms, divided by the smallest singular value of its \
                Jacobian. Ratio: condition number of the Jacobian. Beyond the fold there is no \
                ray: NaN",
            ratio: "condition",
            error: "error over focal length",
            rounding: true,
            cases: |_| Ok(fold()),
        },
        Sweep {
            key: "coefficients",
            title: "Distortion coefficients up to those of a calibration that is refused, over a \
                whole image",
            oracle: "The same at 33 x 25 points of an image 1.2 focal lengths wide. Ratio: largest \
                condition number of the Jacobian over the image",
            ratio: "condition",
            error: "error over focal length",
            rounding: true,
            cases: |_| Ok(coefficients()),
        },
    ],
};

fn lens(distortion: [f64; 5]) -> Lens {
    Lens {
        width_px: 960,
        height_px: 720,
        focal_px: DVec2::splat(800.0),
        principal_px: DVec2::new(479.5, 359.5),
        distortion,
    }
}

/// Returns the condition number of the Jacobian (symmetric) and its smallest singular value.
fn singular(lens: &Lens, p: DVec2) -> (f64, f64) {
    let m = lens.distort_jacobian(p);
    let mean = 0.5 * (m.x_axis.x + m.y_axis.y);
    let half = (0.5 * (m.x_axis.x - m.y_axis.y)).hypot(m.x_axis.y);
    let (large, least) = (mean.abs() + half, (mean.abs() - half).abs());
    (large / least, least)
}

/// Returns the error of the inverse at an ideal point, and the allowed error.
fn inverse(lens: &Lens, p: DVec2) -> (f64, f64) {
    let [k1, k2, p1, p2, k3] = lens.distortion.map(f64::abs);
    let r2 = p.length_squared();
    let terms = p.length() * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) + 3.0 * (p1 + p2) * r2;
    let (_, least) = singular(lens, p);
    let found = lens.undistort(lens.distort(p));
    ((found - p).length(), 8.0 * EPS * terms / least)
}

/// Describes the result of the inverse at a point without a ray.
fn no_ray(lens: &Lens, distorted: DVec2) -> String {
    let found = lens.undistort(distorted);
    if found.is_nan() {
        "no ray (NaN)".to_owned()
    } else {
        format!("a ray at {found}")
    }
}

fn fold() -> Vec<Case> {
    let lens = lens([-0.3, 0.0, 0.0, 0.0, 0.0]);
    let edge = (1.0 / 0.9_f64).sqrt();
    let mut cases: Vec<Case> = [0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
        .map(|before| {
            let p = DVec2::from_angle(0.4) * edge * (1.0 - before);
            let (found, allowed) = inverse(&lens, p);
            let name = format!("{before:e} before the fold");
            Case::held(name, singular(&lens, p).0, found, allowed)
        })
        .to_vec();
    for beyond in [1e-6, 0.1, 10.0] {
        // The image of the fold is the farthest point of the distorted image.
        let far = lens.distort(DVec2::X * edge) * (1.0 + beyond);
        let name = format!("{beyond:e} beyond the fold's image");
        cases.push(Case::refused(
            name,
            f64::INFINITY,
            &no_ray(&lens, far),
            "NaN",
        ));
    }
    let behind = DVec2::X * 1.8;
    let placed = lens.place(behind);
    let says = placed.map_or_else(|| "no pixel".to_owned(), |px| px.to_string());
    cases.push(Case::refused(
        "a point behind the fold",
        f64::INFINITY,
        &says,
        "no pixel",
    ));
    cases
}

fn coefficients() -> Vec<Case> {
    let mut cases = Vec::new();
    for (name, distortion) in [
        ("k1 = -1e-9", [-1e-9, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = -0.1", [-0.1, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = -0.25", [-0.25, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = -0.26", [-0.26, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = -0.4", [-0.4, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = -1e6", [-1e6, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = 1", [1.0, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = 1000", [1e3, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = 1e6", [1e6, 0.0, 0.0, 0.0, 0.0]),
        ("k1 = -0.9, k2 = 1, k3 = -0.1", [-0.9, 1.0, 0.0, 0.0, -0.1]),
        ("k1 = 10, k2 = -5", [10.0, -5.0, 0.0, 0.0, 0.0]),
        ("p1 = 0.02, p2 = -0.03", [0.0, 0.0, 0.02, -0.03, 0.0]),
        ("p1 = 0.5", [0.0, 0.0, 0.5, 0.0, 0.0]),
        ("k3 = 1e9", [0.0, 0.0, 0.0, 0.0, 1e9]),
    ] {
        let lens = lens(distortion);
        let mut rig: Rig = match Profile::load("webcam-grey") {
            Ok(profile) => profile.nominal_rig(),
            Err(e) => {
                cases.push(Case::failed(name, f64::NAN, &e.to_string()));
                continue;
            }
        };
        rig.camera.lens = lens;
        if let Err(v) = rig.check() {
            let says = format!("{}: {}; expected {}", v.field, v.found, v.allowed);
            cases.push(Case::refused(name, f64::INFINITY, &says, "folds over"));
            continue;
        }
        // Invert the ideal point of each pixel again, from its distorted point.
        let (mut worst, mut condition) = ((0.0, f64::INFINITY), 1.0_f64);
        for v in 0..25 {
            for u in 0..33 {
                let px = DVec2::new(f64::from(u) * 959.0 / 32.0, f64::from(v) * 719.0 / 24.0);
                let p = lens.ray(px).truncate();
                let (found, allowed) = inverse(&lens, p);
                condition = condition.max(singular(&lens, p).0);
                worse(&mut worst, found, allowed);
            }
        }
        cases.push(Case::held(name, condition, worst.0, worst.1));
    }
    cases
}
