//! Tests depth and its standard deviation on a known plane.

use super::*;
use phasmid_geometry::{Lens, View};

fn rig(camera: [f64; 5], projector: [f64; 5]) -> Rig {
    let view = |width_px, height_px, f, principal_px, distortion, pose| View {
        lens: Lens {
            width_px,
            height_px,
            focal_px: DVec2::splat(f),
            principal_px,
            distortion,
        },
        rig_from_view: pose,
    };
    Rig {
        camera: view(
            160,
            90,
            90.0,
            DVec2::new(79.3, 44.9),
            camera,
            Pose::IDENTITY,
        ),
        projector: view(
            1920,
            1080,
            2751.0,
            DVec2::new(2060.0, 540.0),
            projector,
            Pose::from_xyz_deg(DVec3::new(400.0, 20.0, -15.0), DVec3::new(1.0, -3.0, 2.0)),
        ),
        noise: None,
        covariance: None,
    }
}

/// Maximum error over the lit part of a tilted plane, of the row kernel and of the f64
/// implementation.
fn worst(rig: &Rig, use_x: bool, use_y: bool) -> (f64, f64) {
    let triangulator = Triangulator::new(rig, 160, 90).unwrap();
    let (mut row_worst, mut f64_worst, mut lit) = (0.0f64, 0.0f64, 0);
    for v in 0..90 {
        let (mut xs, mut ys) = (vec![f32::NAN; 160], vec![f32::NAN; 160]);
        let mut truth = vec![f64::NAN; 160];
        for u in 0..160 {
            let camera_px = DVec2::new(u as f64, v as f64);
            let d = rig.camera.ray(camera_px);
            let t = 1000.0 / (1.0 + 0.3 * d.x - 0.2 * d.y);
            let px = rig.projector.project(d * t).unwrap();
            if !rig.projector.lens.contains(px) {
                continue;
            }
            (truth[u], xs[u], ys[u]) = (t, px.x as f32, px.y as f32);
            lit += 1;
            let measured = |on: bool, px| on.then_some(Measured { px, sigma: 0.02 });
            let (x, y) = (measured(use_x, px.x), measured(use_y, px.y));
            let (depth, _) = triangulator.depth(camera_px, x, y).unwrap();
            f64_worst = f64_worst.max((depth - t).abs());
        }
        let sigma = vec![0.02; 160];
        let (mut depth, mut sd) = (vec![0.0; 160], vec![0.0; 160]);
        let row = |on: bool, px| on.then_some(CoordinateRow { px, sigma: &sigma });
        triangulator.row(v, row(use_x, &xs), row(use_y, &ys), &mut depth, &mut sd);
        for (d, t) in depth.iter().zip(&truth) {
            assert_eq!(d.is_nan(), t.is_nan());
            row_worst = row_worst.max((f64::from(*d) - t).abs());
        }
    }
    assert!(lit > 1500, "{lit}");
    (row_worst, f64_worst)
}

#[test]
fn depth_is_exact_with_and_without_distortion() {
    let k = [-0.12, 0.03, 8e-4, -5e-4, 0.0];
    let none = [0.0; 5];
    for (camera, projector) in [(none, none), (k, none), (none, k), (k, k)] {
        for (use_x, use_y) in [(true, false), (true, true)] {
            let (row, exact) = worst(&rig(camera, projector), use_x, use_y);
            // The error due to f32 coordinates and rays.
            assert!(row < 5e-4, "row {row:e} mm");
            assert!(exact < 1e-7, "f64 {exact:e} mm");
        }
    }
}

#[test]
fn sigma_is_the_slope_of_depth() {
    let rig = rig([0.0; 5], [-0.12, 0.03, 8e-4, -5e-4, 0.0]);
    let triangulator = Triangulator::new(&rig, 160, 90).unwrap();
    let at = |px| {
        let x = Some(Measured { px, sigma: 0.02 });
        triangulator.depth(DVec2::new(80.0, 40.0), x, None).unwrap()
    };
    let (h, middle) = (0.01, at(960.0));
    let slope = (at(960.0 + h).0 - at(960.0 - h).0) / (2.0 * h);
    assert!((slope.abs() * 0.02 / middle.1 - 1.0).abs() < 1e-4);
}

#[test]
fn impossible_coordinates_give_no_depth() {
    let rig = rig([0.0; 5], [0.0; 5]);
    let triangulator = Triangulator::new(&rig, 160, 90).unwrap();
    let px = DVec2::new(80.0, 40.0);
    let x = |px| Some(Measured { px, sigma: 0.02 });
    assert!(triangulator.depth(px, None, None).is_none());
    // A column at the ray's vanishing point gives no depth, nor does a column beyond it.
    let far = rig.projector.project(rig.camera.ray(px) * 1e7).unwrap();
    assert!(triangulator.depth(px, x(far.x), None).is_none());
    assert!(triangulator.depth(px, x(far.x + 500.0), None).is_none());
    // A projector row that does not intersect this ray at the column's depth.
    let near = rig.projector.project(rig.camera.ray(px) * 1e3).unwrap();
    assert!(triangulator.depth(px, x(near.x), x(near.y)).is_some());
    assert!(
        triangulator
            .depth(px, x(near.x), x(near.y + 40.0))
            .is_none()
    );
    assert!(Triangulator::new(&rig, 90, 160).is_err());
}

/// A column whose plane is parallel to the camera's ray does not intersect it.
#[test]
fn parallel_rays_have_no_depth() {
    let mut rig = rig([0.0; 5], [0.0; 5]);
    rig.projector.rig_from_view = Pose::from_xyz_deg(DVec3::X * 400.0, DVec3::ZERO);
    rig.camera.lens.principal_px = DVec2::new(79.0, 45.0);
    let triangulator = Triangulator::new(&rig, 160, 90).unwrap();
    let px = rig.projector.lens.principal_px.x;
    for sigma in [0.0, 0.02] {
        let x = Measured { px, sigma };
        let at = DVec2::new(79.0, 45.0);
        assert_eq!(triangulator.depth(at, Some(x), None), None);
        let (mut depth, mut sd) = ([0.0; 160], [0.0; 160]);
        let x = CoordinateRow {
            px: &[px as f32; 160],
            sigma: &[sigma as f32; 160],
        };
        triangulator.row(45, Some(x), None, &mut depth, &mut sd);
        assert!(depth[79].is_nan() && sd[79].is_nan(), "{}", depth[79]);
        assert!(depth.iter().all(|z| !z.is_infinite()));
    }
}

/// The parallax of a far point is less than the distortion: the undistorted plane lies behind the
/// lens.
#[test]
fn a_lens_that_bends_more_than_the_parallax_loses_no_point() {
    let mut rig = rig([0.0; 5], [2.0, 0.2, 2e-3, -4e-3, 0.0]);
    rig.projector.rig_from_view =
        Pose::from_xyz_deg(DVec3::new(400.0, 20.0, -16.0), DVec3::new(1.0, -18.0, 2.0));
    rig.projector.lens.principal_px.x = 959.5;
    let triangulator = Triangulator::new(&rig, 160, 90).unwrap();
    let mut lit = 0;
    for (u, v) in (0..160).flat_map(|u| (0..90).map(move |v| (u, v))) {
        let at = DVec2::new(f64::from(u), f64::from(v));
        for t in [300.0, 1e3, 1e4, 1e5] {
            let px = rig.projector.project(rig.camera.ray(at) * t);
            let Some(px) = px.filter(|px| rig.projector.lens.contains(*px)) else {
                continue;
            };
            lit += 1;
            let [x, y] = [px.x, px.y].map(|px| Some(Measured { px, sigma: 1e-6 }));
            for y in [y, None] {
                let (depth, _) = triangulator.depth(at, x, y).unwrap();
                assert!((depth / t - 1.0).abs() < 1e-9, "{at} {t}: {depth}");
            }
        }
    }
    assert!(lit > 5000, "{lit}");
}
