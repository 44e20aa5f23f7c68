//! Tests closest points against an exact search, and normals and curvature against closed forms.

use super::super::testing::{Random, is_front, patient, plane, scan, sphere};
use super::*;
use phasmid_geometry::MeshTree;

#[test]
fn feet_are_the_nearest_points() {
    let mesh = patient(20_000);
    let reference = Reference::new(&mesh, &Region::All).unwrap();
    let tree = MeshTree::new(&mesh);
    let mut random = Random::new(1);
    // Noise in millimetres, the number of points per thousand that may have another foot, and the
    // distance in millimetres by which this foot may be farther away. At 20 mm some points lie inside
    // folds and near the opposite side.
    for (reach, most, by) in [(0.3, 2, 0.005), (3.0, 20, 0.1), (20.0, 80, 6.0)] {
        let (mut elsewhere, mut farthest, mut all) = (0, 0.0_f64, 0);
        for p in scan(&mesh, 8000, &mut random, is_front) {
            let q = p + random.vector() * reach;
            let exact = tree.closest(q).unwrap().distance_mm;
            let foot = reference.closest(q);
            let beyond = (foot.point - q).length() - exact;
            assert!(beyond > -1e-9);
            elsewhere += u32::from(beyond > 1e-9);
            farthest = farthest.max(beyond);
            all += 1;
            // The foot agrees with its weights and its triangle.
            let corners = reference.triangles()[foot.triangle as usize]
                .map(|i| reference.vertices()[i as usize]);
            let at: DVec3 = (0..3).map(|k| corners[k] * foot.weights[k]).sum();
            assert!((at - foot.point).length() < 1e-9);
            // After a small step a walk finds the new foot.
            let moved = q + random.vector() * 0.2;
            let near = reference.closest_near(moved, foot.triangle);
            let grid = reference.closest(moved);
            let apart = (near.point - moved).length() - (grid.point - moved).length();
            assert!(apart < by, "{apart}");
        }
        assert!(
            elsewhere * 1000 <= most * all,
            "{reach}: {elsewhere} of {all}"
        );
        assert!(farthest < by, "{reach}: {farthest}");
    }
}

#[test]
fn normals_are_those_of_the_smooth_surface() {
    let mesh = sphere();
    let reference = Reference::new(&mesh, &Region::All).unwrap();
    let centre = DVec3::new(10.0, 20.0, -40.0);
    let mut random = Random::new(2);
    let mut worst = 0.0_f64;
    for p in scan(&mesh, 2000, &mut random, |p| {
        (p - centre).truncate().abs().max_element() < 80.0
    }) {
        let foot = reference.closest(p + random.vector());
        let out = (foot.point - centre).normalize();
        worst = worst.max(foot.normal.dot(out).min(1.0).acos());
    }
    // Facets of 2.5 mm on a radius of 150 mm are tilted by up to 8 mrad; interpolated normals by a
    // tenth of that.
    assert!(worst < 1e-3, "{worst}");
    // The estimate from the facets is an upper bound.
    let told = reference.normal_sd_rad();
    assert!((1e-4..8e-3).contains(&told), "{told}");
}

#[test]
fn estimates_roughness_of_facets() {
    let mut mesh = plane();
    let mut random = Random::new(3);
    for v in &mut mesh.vertices {
        v.z += 0.05 * random.normal();
    }
    let reference = Reference::new(&mesh, &Region::All).unwrap();
    // The true normal is z: measure the slopes of the interpolated normals at feet, per axis.
    let mut squares = 0.0;
    let points = scan(&plane(), 4000, &mut random, |_| true);
    for &p in &points {
        let foot = reference.closest(p);
        squares += foot.normal.truncate().length_squared() / 2.0;
    }
    let truth = (squares / points.len() as f64).sqrt();
    let told = reference.normal_sd_rad();
    assert!((0.5..2.0).contains(&(told / truth)), "{told} for {truth}");
}

#[test]
fn regions_select_triangles_wholly_inside() {
    let mesh = plane();
    let area = |region: &Region| Reference::new(&mesh, region).unwrap().area_mm2();
    assert!((area(&Region::All) - 160_000.0).abs() < 1e-6);
    let square = Region::Box {
        lo: DVec3::new(-50.1, -50.1, 0.0),
        hi: DVec3::new(50.1, 50.1, 60.0),
    };
    assert!((area(&square) - 10_000.0).abs() < 1e-6);
    let disc = Region::Sphere {
        centre: DVec3::new(0.0, 0.0, 30.0),
        radius_mm: 100.0,
    };
    // Only triangles wholly inside count: less than the disc by half a cell around its edge.
    let share = area(&disc) / (std::f64::consts::PI * 1e4);
    assert!((0.9..1.0).contains(&share), "{share}");
    let corners = [(-100.1, -100.1), (100.1, -100.1), (-100.1, 100.1)];
    let triangle = Region::Polygon(corners.map(|(x, y)| glam::DVec2::new(x, y)).to_vec());
    let share = area(&triangle) / 20_000.0;
    assert!((0.93..1.02).contains(&share), "{share}");
    assert!((area(&Region::Vertices(vec![0, 1, 81, 82])) - 25.0).abs() < 1e-9);
    // A polygon excludes the back of a closed body.
    let body = patient(8000);
    let wide = [(-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0)];
    let chest = Region::Polygon(wide.map(|(x, y)| glam::DVec2::new(x, y)).to_vec());
    let reference = Reference::new(&body, &chest).unwrap();
    for t in 0..reference.triangles().len() as u32 {
        let z = reference.vertices()[reference.triangles()[t as usize][0] as usize].z;
        assert!(!reference.is_inside(t) || z > 0.0);
    }
}

#[test]
fn refuses_invalid_regions_by_name() {
    let mesh = plane();
    let words = |region: &Region| match Reference::new(&mesh, region) {
        Err(e) => e.to_string(),
        Ok(_) => panic!("taken"),
    };
    let flat = Region::Box {
        lo: DVec3::ZERO,
        hi: DVec3::new(1.0, 0.0, 1.0),
    };
    assert!(words(&flat).contains("lo below hi"));
    let none = Region::Sphere {
        centre: DVec3::splat(1e4),
        radius_mm: 1.0,
    };
    assert!(words(&none).contains("no triangle"));
    assert!(words(&Region::Vertices(vec![9999])).contains("vertices 0 to 6560"));
    let bad = Region::Sphere {
        centre: DVec3::NAN,
        radius_mm: 1.0,
    };
    assert!(words(&bad).contains("positive radius"));
    assert!(words(&Region::Polygon(vec![])).contains("0 corners"));
}

#[test]
fn the_end_of_a_surface_is_a_border() {
    let reference = Reference::new(&plane(), &Region::All).unwrap();
    assert!(!reference.closest(DVec3::new(3.0, 3.0, 35.0)).border);
    assert!(reference.closest(DVec3::new(203.0, 3.0, 35.0)).border);
    assert!(reference.closest(DVec3::new(203.0, 203.0, 35.0)).border);
    let one = reference.closest(DVec3::new(0.0, 0.0, 30.0)).triangle;
    let covered = reference.covered_mm2(std::iter::once(one));
    assert!((200.0..800.0).contains(&covered), "{covered}");
}

#[test]
fn noise_lifts_points_off_a_bent_surface() {
    use super::super::testing::cylinder;
    let ball = Reference::new(&sphere(), &Region::All).unwrap();
    let tube = Reference::new(&cylinder(), &Region::All).unwrap();
    let top = |reference: &Reference, p: DVec3| reference.closest(p).triangle;
    let t = top(&ball, DVec3::new(20.0, 40.0, 110.0));
    // s^2 / R.
    assert!((ball.lift_mm(t, 2.0) / (4.0 / 150.0) - 1.0).abs() < 0.03);
    let t = top(&tube, DVec3::new(0.0, 10.0, 20.0));
    assert!((tube.lift_mm(t, 2.0) / (4.0 / 240.0) - 1.0).abs() < 0.03);
    // The cylinder is curved across its axis, but neither along the axis nor along the normal.
    let lift = |along| tube.lift_along_mm(t, 2.0, along);
    assert!((lift(DVec3::X) / (4.0 / 240.0) - 1.0).abs() < 0.03);
    assert!(lift(DVec3::Y).abs() < 1e-4 && lift(DVec3::Z).abs() < 1e-4);
}
