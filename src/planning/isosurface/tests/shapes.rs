//! Spheres, ellipsoids and tori, on rotated grids with non-cubic voxels.

use super::*;

fn facet(mesh: &Mesh, t: usize) -> (DVec3, DVec3) {
    let [a, b, c] = mesh.corners(t);
    ((a + b + c) / 3.0, (b - a).cross(c - a).normalize())
}

/// Order of convergence from each grid to the next, twice as fine.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect()
}

#[test]
fn a_sphere_converges_as_linear_interpolation_does() {
    let (radius, centre) = (40.0, DVec3::new(-31.0, 220.0, 904.0));
    let [mut distance, mut normal, mut area, mut volume] = [const { Vec::new() }; 4];
    for fine in [1.0, 2.0, 4.0] {
        let spacing = DVec3::new(3.0, 4.0, 6.0) / fine;
        let mesh = surface(grid(44.0, spacing, centre, fine == 2.0), |p| {
            radius - (p - centre).length()
        });
        let facts = closed_manifold(&mesh);
        assert_eq!((facts.euler, facts.components), (2, 1));
        let off = |p: &DVec3| ((*p - centre).length() - radius).abs();
        distance.push(mesh.vertices.iter().map(off).fold(0.0, f64::max));
        // Area-weighted mean angle between mesh normals and true normals.
        let mut angle = 0.0;
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(t);
            let (middle, n) = facet(&mesh, t);
            let cos = n.dot((middle - centre).normalize());
            assert!(cos > 0.0, "a normal that points inwards");
            angle += cos.min(1.0).acos() * (b - a).cross(c - a).length() / 2.0;
        }
        normal.push(angle / facts.area);
        area.push((facts.area / (4.0 * PI * radius * radius) - 1.0).abs());
        volume.push((facts.volume / (4.0 / 3.0 * PI * radius.powi(3)) - 1.0).abs());
    }
    // A chord of 6 mm has a sagitta of at most 6^2 / (8 x 40) = 0.11 mm.
    assert!(distance[0] < 0.12, "{distance:?}");
    assert!(
        normal[0] < 0.03 && area[0] < 5e-3 && volume[0] < 1e-2,
        "{normal:?} {area:?} {volume:?}"
    );
    for order in [orders(&distance), orders(&area), orders(&volume)].concat() {
        assert!((1.75..2.25).contains(&order), "{order}");
    }
    for order in orders(&normal) {
        assert!((0.85..1.25).contains(&order), "{order}");
    }
}

#[test]
fn an_ellipsoid_has_its_volume_and_normals() {
    let axes = DVec3::new(30.0, 20.0, 50.0);
    let mesh = surface(
        grid(52.0, DVec3::new(1.0, 1.5, 2.0), DVec3::ZERO, false),
        |p| 1.0 - (p / axes).length_squared(),
    );
    let facts = closed_manifold(&mesh);
    assert_eq!((facts.euler, facts.components), (2, 1));
    let exact = 4.0 / 3.0 * PI * axes.element_product();
    assert!(
        (facts.volume / exact - 1.0).abs() < 3e-3,
        "{}",
        facts.volume / exact
    );
    for v in &mesh.vertices {
        // Distance to first order: value over gradient.
        let gradient = 2.0 * *v / (axes * axes);
        let off = ((*v / axes).length_squared() - 1.0) / gradient.length();
        assert!(off.abs() < 0.1, "{off} mm at {v}");
    }
    for t in 0..mesh.triangles.len() {
        let (middle, normal) = facet(&mesh, t);
        let outwards = (middle / (axes * axes)).normalize();
        assert!(normal.dot(outwards) > 0.8);
    }
}

#[test]
fn a_torus_keeps_its_hole() {
    let (big, small) = (30.0, 9.0);
    let mesh = surface(
        grid(41.0, DVec3::new(1.2, 1.0, 1.6), DVec3::ZERO, true),
        |p| small - DVec3::new(p.x.hypot(p.y) - big, p.z, 0.0).length(),
    );
    let facts = closed_manifold(&mesh);
    assert_eq!((facts.euler, facts.components), (0, 1));
    let (volume, area) = (
        2.0 * PI * PI * big * small * small,
        4.0 * PI * PI * big * small,
    );
    assert!((facts.volume / volume - 1.0).abs() < 1e-2);
    assert!((facts.area / area - 1.0).abs() < 1e-2);
    for v in &mesh.vertices {
        let off = DVec3::new(v.x.hypot(v.y) - big, v.z, 0.0).length() - small;
        assert!(off.abs() < 0.05, "{off}");
    }
}
