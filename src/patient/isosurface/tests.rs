//! Bodies whose surface has a closed form, and noise, whose surface has to be one all the same.

use super::*;
use crate::patient::volume::{Grid, Voxels};
use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;
use std::f64::consts::PI;

/// A closed mesh, looked at from all sides.
struct Facts {
    /// Vertices - edges + triangles.
    euler: i64,
    components: usize,
    volume: f64,
    area: f64,
}

/// What a closed manifold has; panics where the mesh is none: every side of a triangle is another's
/// in the other direction, and the triangles at every vertex make one fan.
fn closed_manifold(mesh: &Mesh) -> Facts {
    let mut sides = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert_ne!(p, q);
            assert_eq!(sides.insert((p, q), r), None, "a side met twice");
        }
    }
    let mut fans = vec![0; mesh.vertices.len()];
    let mut first = vec![None; mesh.vertices.len()];
    for &(p, q) in sides.keys() {
        assert!(sides.contains_key(&(q, p)), "an open side");
        fans[p as usize] += 1;
        first[p as usize] = Some(q);
    }
    for (p, first) in first.iter().enumerate() {
        let p = p as u32;
        let begin = first.expect("a vertex of some triangle");
        let (mut at, mut steps) = (begin, 0);
        loop {
            at = sides[&(p, at)];
            steps += 1;
            if at == begin {
                break;
            }
        }
        assert_eq!(steps, fans[p as usize], "two fans at a vertex");
    }
    let mut parents: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn root(parents: &mut [usize], mut at: usize) -> usize {
        while parents[at] != at {
            parents[at] = parents[parents[at]];
            at = parents[at];
        }
        at
    }
    for t in &mesh.triangles {
        for i in [1, 2] {
            let (a, b) = (root(&mut parents, t[0] as usize), root(&mut parents, t[i] as usize));
            parents[a] = b;
        }
    }
    let components = (0..parents.len()).filter(|&v| parents[v] == v).count();
    let (mut volume, mut area) = (0.0, 0.0);
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        volume += a.dot(b.cross(c)) / 6.0;
        area += (b - a).cross(c - a).length() / 2.0;
    }
    let count = |n: usize| n as i64;
    Facts {
        euler: count(mesh.vertices.len()) - count(sides.len() / 2) + count(mesh.triangles.len()),
        components,
        volume,
        area,
    }
}

/// A grid about a centre, turned, with voxels that are no cubes; left-handed if asked.
fn grid(reach_mm: f64, spacing_mm: DVec3, centre: DVec3, mirrored: bool) -> Grid {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.3, 0.9));
    let hand = if mirrored { -1.0 } else { 1.0 };
    let direction = turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, hand));
    let size = spacing_mm.to_array().map(|mm| (2.0 * reach_mm / mm).ceil() as usize + 2);
    let half = DVec3::from_array(size.map(|n| (n as f64 - 1.0) / 2.0)) * spacing_mm;
    Grid {
        size,
        spacing_mm,
        // No voxel's centre is where symmetry would put it.
        origin_mm: centre - direction * (half + 0.3 * spacing_mm),
        direction,
    }
}

fn surface(grid: Grid, value: impl Fn(DVec3) -> f64 + Sync) -> Mesh {
    let volume = Volume::of(grid, value, "test").unwrap();
    isosurface(&volume, 0.0, Parts::All, "test").unwrap()
}

fn facet(mesh: &Mesh, t: usize) -> (DVec3, DVec3) {
    let [a, b, c] = mesh.corners(t);
    ((a + b + c) / 3.0, (b - a).cross(c - a).normalize())
}

/// Order at which errors fall from each grid to the next, twice as fine.
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
        // The mean of normals' angles, by area.
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
    // A chord of 6 mm sags by 6^2 / (8 x 40) = 0.11 mm at most.
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
    assert!((facts.volume / exact - 1.0).abs() < 3e-3, "{}", facts.volume / exact);
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
    let (volume, area) = (2.0 * PI * PI * big * small * small, 4.0 * PI * PI * big * small);
    assert!((facts.volume / volume - 1.0).abs() < 1e-2);
    assert!((facts.area / area - 1.0).abs() < 1e-2);
    for v in &mesh.vertices {
        let off = DVec3::new(v.x.hypot(v.y) - big, v.z, 0.0).length() - small;
        assert!(off.abs() < 0.05, "{off}");
    }
}

/// The part of [-1/2, 1/2] below x: how full a voxel is whose centre is x voxels inside.
fn full(x: f64) -> f64 {
    (x + 0.5).clamp(0.0, 1.0)
}

#[test]
fn partial_volumes_put_a_plane_where_theory_says() {
    // A voxel that a plane crosses is as full as it is: Hounsfield units of air (-1000) and tissue
    // (40). Between one that is f = 1/2 + x full and an empty one the level c is met at 1 - c / f
    // where x was right: off by 3/2 - 2 sqrt c at worst, 0.0858 voxels at a half, and as much with c
    // from the other side. A scanner's blur only makes it less.
    for (level, part) in [(-480.0, 0.5), (SKIN_HU, 0.5 / 1.04), (-400.0, 0.6 / 1.04)] {
        let worst = (0..400)
            .map(|step| {
                let plane = 4.0 + f64::from(step) / 400.0;
                let grid = Grid::upright([3, 3, 9], DVec3::new(1.0, 1.0, 2.5), DVec3::ZERO);
                let hu = |i: usize| -1000.0 + 1040.0 * full(plane - (i / 9) as f64);
                let voxels = (0..81).map(|i| hu(i).round() as i16).collect();
                let volume = Volume::new(grid, Voxels::I16(voxels), "plane").unwrap();
                let mesh = isosurface(&volume, level, Parts::All, "plane").unwrap();
                closed_manifold(&mesh);
                // The lowest cap is at the volume's face, the highest vertices are the plane's.
                let (low, high) = mesh.bounds().unwrap();
                assert!((low.z + 1.25).abs() < 1e-12);
                (high.z / 2.5 - plane).abs()
            })
            .fold(0.0, f64::max);
        let c: f64 = f64::max(part, 1.0 - part);
        let theory = 1.5 - 2.0 * (1.0 - c).sqrt();
        // Whole numbers are off by half a unit of 1040, which the division may double.
        assert!((worst - theory).abs() < 2e-3, "{level}: {worst}, not {theory}");
    }
}

/// How full a voxel is of a ball: 16 x 16 lines through it, each by its length.
fn filling(grid: &Grid, centre: DVec3, radius: f64, p: DVec3) -> f64 {
    let out = p - centre;
    if (out.length() - radius).abs() > 2.0 {
        return f64::from(u8::from(out.length() < radius));
    }
    // Lines along the axis that meets the ball most steeply.
    let steep = (grid.direction.transpose() * out).abs() * grid.spacing_mm;
    let along = (0..3).fold(0, |a, b| if steep[b] > steep[a] { b } else { a });
    let (u, v) = ((along + 1) % 3, (along + 2) % 3);
    let half = grid.spacing_mm[along] / 2.0;
    let way = grid.direction.col(along);
    let mut sum = 0.0;
    for n in 0..256 {
        let mut part = DVec3::ZERO;
        part[u] = (f64::from(n % 16) + 0.5) / 16.0 - 0.5;
        part[v] = (f64::from(n / 16) + 0.5) / 16.0 - 0.5;
        let from = out + grid.direction * (grid.spacing_mm * part);
        let middle = -from.dot(way);
        let square = radius * radius - (from + middle * way).length_squared();
        if square > 0.0 {
            let reach = square.sqrt();
            let inside = (middle + reach).min(half) - (middle - reach).max(-half);
            sum += inside.max(0.0) / (2.0 * half);
        }
    }
    sum / 256.0
}

#[test]
fn partial_volumes_put_a_sphere_within_a_tenth_of_a_voxel() {
    let (radius, centre) = (35.0, DVec3::new(1.0, 2.0, 3.0));
    let grid = grid(38.0, DVec3::new(1.0, 1.0, 2.5), centre, false);
    let hu = |p| (-1000.0 + 1040.0 * filling(&grid, centre, radius, p)).round();
    let volume = Volume::of(grid, hu, "ct").unwrap();
    let mesh = isosurface(&volume, -480.0, Parts::LargestFilled, "ct").unwrap();
    closed_manifold(&mesh);
    let (mut worst, mut square) = (0.0_f64, 0.0);
    for v in &mesh.vertices {
        // In voxels along the axis that goes through the surface most steeply.
        let out = (*v - centre).normalize();
        let steps = (grid.direction.transpose() * out).abs() * grid.spacing_mm;
        let voxel = steps.max_element();
        let off = ((*v - centre).length() - radius) / voxel;
        worst = worst.max(off.abs());
        square += off * off;
    }
    let rms = (square / mesh.vertices.len() as f64).sqrt();
    assert!(worst < 0.1, "{worst} voxels at worst, {rms} RMS");
    assert!(rms < 0.05, "{rms} RMS");
}

#[test]
fn a_body_alone_remains_and_its_cavities_if_wanted() {
    let grid = Grid::upright([60, 50, 40], DVec3::ONE, DVec3::ZERO);
    let ball = |p: DVec3, x: f64, y: f64, z: f64, r: f64| r - (p - DVec3::new(x, y, z)).length();
    // A body with a lung that a windpipe joins to the first slice, and a bubble; a couch, and a
    // marker within the lung that touches nothing.
    let value = |p: DVec3| {
        let body = ball(p, 25.0, 25.0, 12.0, 20.0);
        let lung = ball(p, 25.0, 25.0, 10.0, 7.0);
        let windpipe = (3.0 - (p - DVec3::new(25.0, 25.0, p.z)).length()).min(10.0 - p.z);
        let bubble = ball(p, 38.0, 25.0, 12.0, 3.0);
        let marker = ball(p, 25.0, 25.0, 12.0, 1.5);
        let couch = 1.5 - (p.x - 54.0).abs();
        body.min(-lung).min(-windpipe).min(-bubble).max(marker).max(couch)
    };
    let volume = Volume::of(grid, value, "ct").unwrap();
    let parts = |parts| closed_manifold(&isosurface(&volume, 0.0, parts, "ct").unwrap());
    let [all, largest, filled] =
        [Parts::All, Parts::Largest, Parts::LargestFilled].map(parts);
    // Body with lung (a dent, by the windpipe), bubble, marker, couch.
    assert_eq!(all.components, 4);
    assert_eq!(largest.components, 2);
    assert_eq!((filled.components, filled.euler), (1, 2));
    // The cap of the first slice is at its outer faces, half a millimetre below.
    let cut: f64 = 20.0 - 12.5;
    let ball = 4.0 / 3.0 * PI * 8000.0 - PI * cut * cut * (60.0 - cut) / 3.0;
    assert!((filled.volume / ball - 1.0).abs() < 5e-3, "{}", filled.volume / ball);
    let bubble = 4.0 / 3.0 * PI * 27.0;
    assert!(filled.volume - largest.volume > bubble + 4.0 / 3.0 * PI * 343.0);
}

#[test]
fn noise_has_a_closed_manifold_surface_too() {
    let mut state = 9_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 40) as i16
    };
    for (ni, nj, nk) in [(1, 1, 1), (2, 3, 4), (63, 5, 4), (64, 4, 5), (130, 7, 6), (9, 20, 31)] {
        for level in [-6.0, 0.0, 13.0, 27.0] {
            let grid = Grid::upright([ni, nj, nk], DVec3::new(1.0, 0.7, 3.0), DVec3::ZERO);
            // Few numbers, so that many voxels stand on the level itself.
            let voxels: Vec<i16> = (0..ni * nj * nk).map(|_| next() % 33).collect();
            let volume = Volume::new(grid, Voxels::I16(voxels), "noise").unwrap();
            let all = match isosurface(&volume, level, Parts::All, "noise") {
                Ok(mesh) => mesh,
                Err(e) => {
                    assert!(e.to_string().contains("no voxel of"), "{e}");
                    continue;
                }
            };
            closed_manifold(&all);
            for v in &all.vertices {
                let index = grid.index(*v);
                // Inside of the centres' box all are on the level, but for what the least distance
                // from centres moves.
                if index.cmpge(DVec3::ZERO).all() && index.cmple(grid.last()).all() {
                    assert!((volume.nearest(index) - level).abs() < 0.1, "{index}");
                }
            }
            let facts = |parts| closed_manifold(&isosurface(&volume, level, parts, "n").unwrap());
            let largest = facts(Parts::Largest);
            let filled = facts(Parts::LargestFilled);
            assert_eq!(filled.components, 1);
            assert!(filled.volume >= largest.volume && largest.volume > 0.0);
            assert!(filled.area > 0.0);
        }
    }
}

#[test]
fn the_same_on_any_number_of_threads() {
    let grid = grid(20.0, DVec3::new(1.0, 1.1, 1.3), DVec3::ZERO, false);
    let volume = Volume::of(grid, |p| 15.0 - p.length(), "ball").unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let mesh = || isosurface(&volume, 0.0, Parts::LargestFilled, "ball").unwrap();
        pool.unwrap().install(mesh)
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn a_level_that_nothing_reaches_is_named() {
    let grid = Grid::upright([2, 2, 2], DVec3::ONE, DVec3::ZERO);
    let air = Volume::new(grid, Voxels::I16(vec![-1000; 8]), "ct").unwrap();
    let words = |level| isosurface(&air, level, Parts::All, "ct.mha").unwrap_err().to_string();
    assert_eq!(
        words(-500.0),
        "ct.mha: no voxel of -500 or more; allowed: a level up to -1000"
    );
    assert!(words(f64::NAN).contains("a level of NaN"));
    // What fills the volume ends at its outer faces.
    let block = closed_manifold(&isosurface(&air, -1000.0, Parts::All, "ct").unwrap());
    assert_eq!((block.components, block.euler), (1, 2));
    assert!((4.0..8.0).contains(&block.volume), "{}", block.volume);
}
