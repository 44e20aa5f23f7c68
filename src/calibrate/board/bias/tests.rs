//! Compares the bias with the centre of a projected circle's conic, and with the mean of counted
//! sample points.

use super::*;
use glam::{DMat3, DVec3};

fn lens(distortion: [f64; 5]) -> Lens {
    Lens {
        width_px: 1138,
        height_px: 489,
        focal_px: DVec2::new(632.0, 640.0),
        principal_px: DVec2::new(568.5, 244.0),
        distortion,
    }
}

fn pose(tilt: DVec3) -> Pose {
    Pose::from_xyz_deg(DVec3::new(40.0, -30.0, 1000.0), tilt)
}

/// Centre of the ellipse that is a circle's image: its conic is H^-T C H^-1 (Hartley and Zisserman,
/// "Multiple View Geometry", result 2.13).
fn conic_middle(lens: &Lens, pose: &Pose, centre: DVec2, radius: f64) -> DVec2 {
    let r = pose.rotation;
    let camera = DMat3::from_cols(
        DVec3::X * lens.focal_px.x,
        DVec3::Y * lens.focal_px.y,
        lens.principal_px.extend(1.0),
    );
    let h = camera * DMat3::from_cols(r.x_axis, r.y_axis, pose.point(centre.extend(0.0)));
    let circle = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -radius * radius));
    let inverse = h.inverse();
    let c = inverse.transpose() * circle * inverse;
    -DMat2::from_cols(c.x_axis.truncate(), c.y_axis.truncate()).inverse() * c.z_axis.truncate()
}

#[test]
fn without_distortion_bias_equals_that_of_conic() {
    for tilt in [0.0, 20.0, 45.0, 60.0, -75.0] {
        for centre in [DVec2::ZERO, DVec2::new(-280.0, 210.0)] {
            let (lens, pose) = (lens([0.0; 5]), pose(DVec3::new(tilt, 0.6 * tilt, 30.0)));
            let (px, _) = image(&lens, &pose, centre).unwrap();
            let truth = conic_middle(&lens, &pose, centre, 10.0) - px;
            let bias = of_disc(&lens, &pose, centre, 10.0).unwrap();
            assert!(
                (bias - truth).length() < 1e-9,
                "{tilt} {centre}: {bias} {truth}"
            );
        }
    }
}

/// The reference is the mean of the points of a fine grid in the image whose rays, by the inverse
/// lens model, meet the disc.
#[test]
fn with_distortion_bias_equals_counted_samples() {
    let lens = lens([-0.3, 0.2, 2e-3, -3e-3, 0.05]);
    let pose = pose(DVec3::new(-35.0, 40.0, 10.0));
    let (centre, radius) = (DVec2::new(-250.0, 150.0), 40.0);
    let board_from_camera = pose.inverse();
    let (px, slope) = image(&lens, &pose, centre).unwrap();
    let reach = (slope.x_axis.abs() + slope.y_axis.abs()) * radius * 1.1;
    const N: i32 = 700;
    let (mut sum, mut count) = (DVec2::ZERO, 0.0);
    for i in -N..=N {
        for j in -N..=N {
            let off = reach * DVec2::new(f64::from(i), f64::from(j)) / f64::from(N);
            let ray = board_from_camera.direction(lens.ray(px + off));
            let origin = board_from_camera.translation_mm;
            let mm = (origin - ray * (origin.z / ray.z)).truncate();
            if (mm - centre).length() < radius {
                sum += off;
                count += 1.0;
            }
        }
    }
    let truth = sum / count;
    let bias = of_disc(&lens, &pose, centre, radius).unwrap();
    assert!(
        truth.length() > 0.1 && (bias - truth).length() < 5e-4,
        "{bias} {truth}"
    );
}

#[test]
fn invisible_disc_has_no_bias() {
    let behind = Pose::from_xyz_deg(DVec3::new(0.0, 0.0, -100.0), DVec3::ZERO);
    let across = Pose::from_xyz_deg(DVec3::new(0.0, 0.0, 5.0), DVec3::new(90.0, 0.0, 0.0));
    let nan = Pose::from_xyz_deg(DVec3::splat(f64::NAN), DVec3::ZERO);
    for pose in [behind, across, nan] {
        assert_eq!(of_disc(&lens([0.0; 5]), &pose, DVec2::ZERO, 10.0), None);
    }
    assert_eq!(
        of_disc(&lens([0.0; 5]), &pose(DVec3::ZERO), DVec2::ZERO, f64::NAN),
        None
    );
}
