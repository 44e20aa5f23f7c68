//! Harmonics, volume, centroid and roughness against closed forms.

use super::*;
use phasmid_geometry::shapes::check::closed;

fn rough() -> Shape {
    let mut p = Patient::load("p01-woman-mean").unwrap();
    p.tumour.roughness = 0.35;
    p.tumour.diameter_mm = 30.0;
    Shape::new(&p)
}

#[test]
fn harmonics_are_orthonormal() {
    for (l, k) in [(2, 2), (3, 5), (5, 5), (4, 2)] {
        for i in 0..=2 * l {
            for j in 0..=2 * k {
                let sum: f64 = directions()
                    .map(|(n, w)| w * harmonics(l, n)[i] * harmonics(k, n)[j])
                    .sum();
                let wanted = f64::from(u8::from((l, i) == (k, j)));
                assert!((sum - wanted).abs() < 1e-12, "{l} {i} {k} {j}: {sum}");
            }
        }
    }
}

#[test]
fn volume_equals_that_of_its_ball_and_its_mesh() {
    let shape = rough();
    let ball = PI / 6.0 * 27_000.0;
    assert!((shape.volume_mm3() / ball - 1.0).abs() < 1e-12);
    let quadrature: f64 = shape.inside().map(|(_, v)| v).sum();
    assert!((quadrature / ball - 1.0).abs() < 1e-12);
    // The chords of a mesh cut off volume, by a factor of four less at each level.
    let lacks = |level| 1.0 - closed(&shape.mesh(level)) / ball;
    let (coarse, fine) = (lacks(3), lacks(4));
    assert!(fine > 0.0 && fine < 0.004, "{fine}");
    assert!((coarse / fine - 4.0).abs() < 0.1, "{coarse} {fine}");
}

#[test]
fn centroid_equals_that_of_its_parts() {
    let shape = rough();
    let moment: DVec3 = shape.inside().map(|(x, v)| x * v).sum();
    let off = moment / shape.volume_mm3() - shape.centroid();
    assert!(off.length() < 1e-9, "{off}");
    assert!((shape.centroid() - shape.centre()).length() > 1e-3);
}

#[test]
fn roughness_of_the_tumour_is_within_its_bounds() {
    let shape = rough();
    let radii: Vec<f64> = directions().map(|(n, _)| shape.radius(n)).collect();
    let (least, most) = radii
        .iter()
        .fold((f64::MAX, 0.0f64), |(a, b), &r| (a.min(r), b.max(r)));
    let mean = shape.radius_mm;
    assert!(least >= 0.65 * mean && most <= 1.35 * mean);
    assert!(most - least > 0.15 * mean, "{least} {most}");
    assert!(shape.outside(shape.centre()) < -0.6 * mean);
    assert!(shape.outside(shape.centre() + DVec3::X * 3.0 * mean) > 0.0);
}
