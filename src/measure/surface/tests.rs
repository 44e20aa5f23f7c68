//! Discs compared with the planes and spheres that they sample.

use super::*;

/// A square grid on z = 0.1 x, 1 mm apart in x and y.
fn slope(normals: bool) -> Cloud {
    let points: Vec<[f32; 3]> = (-20..=20)
        .flat_map(|x| (-20..=20).map(move |y| [x as f32, y as f32, 0.1 * x as f32]))
        .collect();
    let n = (DVec3::new(0.1, 0.0, -1.0))
        .normalize()
        .as_vec3()
        .to_array();
    Cloud {
        normals: normals.then(|| vec![n; points.len()]),
        points,
        ..Cloud::default()
    }
}

#[test]
fn distance_to_a_sampled_plane_is_exact() {
    let n = DVec3::new(0.1, 0.0, -1.0).normalize();
    for normals in [true, false] {
        let surfels = Surfels::new(&slope(normals)).unwrap();
        // Between the samples, offset by 0.3 mm along the normal.
        for (x, y) in [(0.0, 0.0), (0.5, 0.5), (3.2, -7.7), (-12.4, 5.1)] {
            let on = DVec3::new(x, y, 0.1 * x);
            for side in [-0.3, 0.3] {
                let foot = surfels.closest(on + n * side).unwrap();
                assert!((foot.distance_mm - 0.3).abs() < 1e-6, "{foot:?}");
                assert!((foot.point - on).length() < 1e-6);
                assert!(foot.normal.dot(n).abs() > 1.0 - 1e-9);
            }
        }
        // Discs end beyond the border; they are not unbounded planes.
        let foot = surfels.closest(DVec3::new(0.0, 26.0, 0.0)).unwrap();
        assert!((4.0..6.0).contains(&foot.distance_mm), "{foot:?}");
    }
}

#[test]
fn a_cloud_samples_a_sphere() {
    let radius = 100.0;
    let points: Vec<[f32; 3]> = (0..20_000)
        .map(|i| {
            // Points of a Fibonacci spiral, about 2.5 mm apart.
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 20_000.0;
            let (sin, cos) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            (DVec3::new(r * cos, r * sin, z) * radius)
                .as_vec3()
                .to_array()
        })
        .collect();
    let surfels = Surfels::new(&Cloud {
        points,
        ..Cloud::default()
    })
    .unwrap();
    for i in 0..500 {
        let t = f64::from(i) * 0.7;
        let out = DVec3::new(t.sin(), t.cos(), (0.3 * t).sin()).normalize();
        let d = surfels.closest(out * (radius + 0.5)).unwrap().distance_mm;
        // A flat disc is off by t^2 / 2R, which is 0.016 with t up to 0.7 of the spacing; the rest is
        // the error of estimated normals.
        assert!((d - 0.5).abs() < 0.02, "{d}");
    }
}

#[test]
fn noise_is_neither_hidden_nor_doubled() {
    // A 1 mm grid with uniform noise of 0.05 mm RMS: the mean of |d| is 0.866 of that.
    let noise = |i: i32, j: i32| {
        let hash = (i.wrapping_mul(73_856_093) ^ j.wrapping_mul(19_349_663)) as u32;
        let mixed = hash
            .wrapping_mul(2_654_435_769)
            .rotate_left(13)
            .wrapping_mul(0x85eb_ca6b);
        (f64::from(mixed >> 8) / f64::from(1 << 24) - 0.5) * 12_f64.sqrt() * 0.05
    };
    let points = (-40..=40)
        .flat_map(|i| (-40..=40).map(move |j| [i as f32, j as f32, noise(i, j) as f32]))
        .collect();
    let surfels = Surfels::new(&Cloud {
        points,
        ..Cloud::default()
    })
    .unwrap();
    let mean = (0..3000)
        .map(|k| {
            let (u, v) = (f64::from(k) * 0.754_877_67, f64::from(k) * 0.569_840_29);
            let p = DVec3::new(70.0 * u.fract() - 35.0, 70.0 * v.fract() - 35.0, 0.0);
            surfels.closest(p).unwrap().distance_mm
        })
        .sum::<f64>()
        / 3000.0;
    assert!((mean / (0.866 * 0.05) - 1.0).abs() < 0.1, "{mean}");
}

#[test]
fn a_point_alone_does_not_cover_a_hole() {
    let mut cloud = slope(false);
    cloud.points.retain(|p| p[0].hypot(p[1]) > 10.0);
    cloud.points.push([0.0, 0.0, 5.0]);
    let surfels = Surfels::new(&cloud).unwrap();
    let d = surfels.closest(DVec3::ZERO).unwrap().distance_mm;
    assert!(d > 3.0, "{d}");
}

#[test]
fn coincident_and_collinear_points_have_correct_distance() {
    for points in [
        vec![[1.0, 2.0, 3.0]],
        vec![[1.0, 2.0, 3.0]; 50],
        (0..50).map(|i| [i as f32, 2.0, 3.0]).collect(),
    ] {
        let surfels = Surfels::new(&Cloud {
            points,
            ..Cloud::default()
        })
        .unwrap();
        let d = surfels
            .closest(DVec3::new(1.0, 2.0, 5.0))
            .unwrap()
            .distance_mm;
        assert_eq!(d, 2.0);
    }
    let none = Cloud {
        points: vec![[f32::NAN; 3]; 3],
        ..Cloud::default()
    };
    assert!(Surfels::new(&none).is_err());
}
