//! Tests overlaps against closed-form solutions.

use super::*;
use std::f64::consts::{PI, TAU};

/// A finely triangulated ball with the exact volume of a ball of `radius`.
fn ball(centre: DVec3, radius: f64) -> Mesh {
    let (rings, around) = (120, 160);
    let mut mesh = Mesh::default();
    let at = |i: u32, k: u32| {
        let (a, b) = (
            PI * f64::from(i) / f64::from(rings),
            TAU * f64::from(k % around) / f64::from(around),
        );
        DVec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos())
    };
    for i in 0..rings {
        for k in 0..around {
            let n = mesh.vertices.len() as u32;
            let corners = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            mesh.vertices.extend(corners);
            mesh.triangles
                .extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
        }
    }
    let (volume, _) = solid_moments(&mesh.vertices, &mesh.triangles);
    let scale = radius * (4.0 / 3.0 * PI / volume).cbrt();
    for v in &mut mesh.vertices {
        *v = centre + *v * scale;
    }
    mesh
}

fn cube(lo: DVec3, side: f64) -> Mesh {
    let vertices = (0..8)
        .map(|i| lo + DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * side)
        .collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    Mesh {
        vertices,
        triangles: quads
            .iter()
            .flat_map(|&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]])
            .collect(),
        ..Mesh::default()
    }
}

#[test]
fn moments_of_cube_and_ball_match_closed_forms() {
    let lo = DVec3::new(1e4, -3.0, 7.0);
    let c = cube(lo, 10.0);
    let (volume, centroid) = solid_moments(&c.vertices, &c.triangles);
    assert!((volume - 1000.0).abs() < 1e-8 && (centroid - lo - 5.0).length() < 1e-8);
    let b = ball(DVec3::new(3.0, 4.0, 5.0), 12.0);
    let (volume, centroid) = solid_moments(&b.vertices, &b.triangles);
    assert!((volume / (4.0 / 3.0 * PI * 1728.0) - 1.0).abs() < 1e-12);
    assert!((centroid - DVec3::new(3.0, 4.0, 5.0)).length() < 1e-9);
}

#[test]
fn overlap_of_shifted_balls_matches_closed_form() {
    let r = 15.0;
    let a = ball(DVec3::ZERO, r);
    for (d, along) in [
        (0.0, DVec3::X),
        (1.0, DVec3::Z),
        (6.0, DVec3::X),
        (20.0, DVec3::ONE.normalize()),
    ] {
        let b = ball(along * d, r);
        // Two caps: V = pi (4 r + d) (2 r - d)^2 / 12; Dice's coefficient is V over the volume of
        // one ball.
        let told = (4.0 * r + d) * (2.0 * r - d).powi(2) / (16.0 * r.powi(3));
        let found = overlap(&a, &b, OVERLAP_COLUMNS).unwrap();
        assert!(
            (found.dice - told).abs() < 3e-4,
            "{d}: {} for {told}",
            found.dice
        );
        assert!(found.error < 3e-4, "{}", found.error);
        let back = overlap(&b, &a, OVERLAP_COLUMNS).unwrap();
        assert!((found.dice - back.dice).abs() < 1e-12);
    }
    let apart = overlap(&a, &ball(DVec3::X * 31.0, r), OVERLAP_COLUMNS).unwrap();
    assert_eq!((apart.dice, apart.both_mm3), (0.0, 0.0));
}

#[test]
fn the_error_falls_with_the_columns() {
    let (a, b) = (
        ball(DVec3::ZERO, 15.0),
        ball(DVec3::new(4.0, 2.0, 1.0), 15.0),
    );
    let error = |columns| overlap(&a, &b, columns).unwrap().error;
    assert!(error(512) < error(32) / 8.0, "{} {}", error(512), error(32));
}

#[test]
fn overlap_of_cubes_is_exact_where_columns_fit() {
    // Columns coincide with the edges of both cubes: each must count once.
    let (a, b) = (
        cube(DVec3::ZERO, 16.0),
        cube(DVec3::new(8.0, 0.0, 4.0), 16.0),
    );
    let found = overlap(&a, &b, 24).unwrap();
    assert!(
        (found.both_mm3 - 8.0 * 16.0 * 12.0).abs() < 1e-9,
        "{found:?}"
    );
    assert!((found.dice - 0.375).abs() < 1e-12 && found.error < 1e-12);
    // A cube with a cavity, whose triangles face into the cavity.
    let mut hollow = cube(DVec3::ZERO, 16.0);
    let inner = cube(DVec3::splat(4.0), 8.0);
    hollow.vertices.extend(&inner.vertices);
    hollow.triangles.extend(
        inner
            .triangles
            .iter()
            .map(|t| [t[0] + 8, t[2] + 8, t[1] + 8]),
    );
    let found = overlap(&hollow, &a, 16).unwrap();
    assert!((found.a_mm3 - 3584.0).abs() < 1e-9 && (found.both_mm3 - 3584.0).abs() < 1e-9);
}

#[test]
fn refuses_mesh_that_is_no_solid_by_name() {
    let c = cube(DVec3::ZERO, 1.0);
    let mut inside_out = c.clone();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let words = overlap(&c, &inside_out, 64).unwrap_err().to_string();
    assert!(words.contains("mesh b: a volume of -1 mm3"), "{words}");
    assert!(overlap(&c, &c, 0).is_err() && overlap(&c, &c, 5000).is_err());
    assert!(overlap(&Mesh::default(), &c, 64).is_err());
}

#[test]
fn statistics_of_target_errors_match_closed_forms() {
    assert!(PositionErrors::of(&[]).is_none());
    let errors: Vec<TargetError> = (1..=100)
        .map(|i| TargetError {
            error_mm: DVec3::new(0.0, f64::from(i) * 0.1, 0.0),
        })
        .collect();
    let all = PositionErrors::of(&errors).unwrap();
    assert!((all.mean_mm - 5.05).abs() < 1e-12 && (all.p95_mm - 9.5).abs() < 1e-12);
    assert!((all.max_mm - 10.0).abs() < 1e-12 && (all.bias_mm[1] - 5.05).abs() < 1e-12);
    // Variance of 1 to n: (n^2 - 1) / 12.
    assert!((all.deviation_mm[1] - 0.1 * (9999.0_f64 / 12.0).sqrt()).abs() < 1e-9);
}
