//! Tests packet traversal against brute force in f64, and tests that no ray passes between triangles.

use super::{Bvh, LANES, NO_TRIANGLE, Packet, Parallel, Scratch};
use crate::{Mesh, shapes};
use glam::{DVec3, Vec3};

/// Numbers in [-1, 1) from a counter (SplitMix64).
fn noise(i: u64) -> f64 {
    let mut z = i
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(0x1234_5678_9abc_def1);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / 2f64.powi(63) - 1.0
}

fn vector(i: u64) -> DVec3 {
    DVec3::new(noise(3 * i), noise(3 * i + 1), noise(3 * i + 2))
}

fn cast(bvh: &Bvh, origin: DVec3, directions: &[DVec3]) -> Vec<(u32, f32)> {
    let mut scratch = Scratch::default();
    directions
        .chunks(LANES)
        .flat_map(|chunk| {
            let all: [Vec3; LANES] =
                std::array::from_fn(|i| chunk[i.min(chunk.len() - 1)].as_vec3());
            let ends = std::array::from_fn(|i| if i < chunk.len() { f32::INFINITY } else { -1.0 });
            let mut packet = Packet::new(origin.as_vec3(), &all, &ends);
            bvh.nearest(&mut packet, &mut scratch);
            (0..chunk.len())
                .map(move |i| (packet.triangle[i], packet.t[i]))
                .collect::<Vec<_>>()
        })
        .collect()
}

fn brute(mesh: &Mesh, o: DVec3, d: DVec3) -> Option<(usize, f64)> {
    (0..mesh.triangles.len())
        .filter_map(|i| {
            let [a, b, c] = mesh.corners(i);
            let (e1, e2) = (b - a, c - a);
            let p = d.cross(e2);
            let det = e1.dot(p);
            let s = o - a;
            let (u, q) = (s.dot(p) / det, s.cross(e1));
            let v = d.dot(q) / det;
            let t = e2.dot(q) / det;
            (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((i, t))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

#[test]
fn a_soup_of_triangles_agrees_with_brute_force() {
    let mesh = Mesh {
        vertices: (0..900)
            .map(|i| vector(i / 3) * 100.0 + vector(i + 5000) * 8.0)
            .collect(),
        triangles: (0..300).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    };
    let bvh = Bvh::build(&mesh.vertices, &mesh.triangles);
    for k in 0..20 {
        let origin = vector(9000 + k) * 150.0;
        // Directions over the whole sphere, so that the lanes of a packet diverge, and three exact axes.
        let mut directions: Vec<_> = (0..96).map(|i| vector(10_000 + 100 * k + i)).collect();
        directions.extend([DVec3::X, DVec3::NEG_Y, DVec3::Z]);
        let found = cast(&bvh, origin, &directions);
        for (d, (triangle, t)) in directions.iter().zip(found) {
            match brute(&mesh, origin, *d) {
                None => assert_eq!(triangle, NO_TRIANGLE),
                Some((_, exact)) => {
                    assert!(triangle != NO_TRIANGLE, "{d} misses at {exact}");
                    assert!(
                        (f64::from(t) - exact).abs() < 2e-4 * exact.max(1.0),
                        "{t} {exact}"
                    );
                }
            }
        }
    }
}

#[test]
fn rays_from_inside_do_not_pass_edges_or_corners() {
    let mesh = shapes::torso(&shapes::Torso {
        triangles: 2000,
        ..shapes::Torso::default()
    });
    let bvh = Bvh::build(&mesh.vertices, &mesh.triangles);
    let (low, high) = mesh.bounds().unwrap();
    let inside = (low + high) / 2.0;
    // Aim exactly at every corner and at points on every edge, in f32.
    let mut targets = mesh.vertices.clone();
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (
                mesh.vertices[t[k] as usize],
                mesh.vertices[t[(k + 1) % 3] as usize],
            );
            targets.extend([0.5, 0.3, 0.071].map(|w| a + (b - a) * w));
        }
    }
    let directions: Vec<_> = targets.iter().map(|p| *p - inside).collect();
    let lost = cast(&bvh, inside, &directions)
        .iter()
        .filter(|(triangle, _)| *triangle == NO_TRIANGLE)
        .count();
    assert_eq!(lost, 0, "of {}", directions.len());
}

#[test]
fn shadow_rays_stop_before_their_end_and_skip_their_own_triangle() {
    let mesh = Mesh {
        vertices: [(-1.0, -1.0, 5.0), (3.0, -1.0, 5.0), (-1.0, 3.0, 5.0)]
            .map(DVec3::from)
            .to_vec(),
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let bvh = Bvh::build(&mesh.vertices, &mesh.triangles);
    let blocked = |end: f32, own: u32| {
        let mut packet = Packet::new(Vec3::ZERO, &[Vec3::Z; LANES], &[end; LANES]);
        packet.triangle = [own; LANES];
        bvh.blocked(&mut packet, &mut Scratch::default());
        packet.t[0] < 0.0
    };
    assert!(blocked(5.1, NO_TRIANGLE));
    assert!(!blocked(4.9, NO_TRIANGLE));
    assert!(!blocked(5.1, 0));
}

#[test]
fn degenerate_and_coincident_triangles_give_correct_hits() {
    let p = DVec3::new(0.0, 0.0, 5.0);
    let mesh = Mesh {
        vertices: vec![
            p,
            p,
            p,
            DVec3::new(-1.0, -1.0, 6.0),
            DVec3::new(3.0, -1.0, 6.0),
            DVec3::new(-1.0, 3.0, 6.0),
        ],
        triangles: std::iter::repeat_n([0, 1, 2], 1000)
            .chain([[3, 3, 4]])
            .chain(std::iter::repeat_n([3, 4, 5], 1000))
            .collect(),
        ..Mesh::default()
    };
    let bvh = Bvh::build(&mesh.vertices, &mesh.triangles);
    let (triangle, t) = cast(&bvh, DVec3::ZERO, &[DVec3::Z])[0];
    assert!((1001..2001).contains(&triangle) && t == 6.0);
    assert!(Bvh::build(&[], &[]).is_empty());
}

#[test]
fn the_nearest_of_close_surfaces_is_among_those_handed_out() {
    // Kilometre-sized triangles 0.01 mm apart at a distance of 1 m: f32 resolves their hits only to
    // 0.1 mm, so only f64 can order them.
    let (sin, cos) = 1.1f64.sin_cos();
    let layer = |k: u32| {
        let offset = DVec3::Z * (1000.0 + 0.01 * f64::from(k * 7 % 16));
        [(-5e5, -5e5), (6e5, -5e5), (-5e5, 6e5)]
            .map(|(x, y)| DVec3::new(x * cos, y, x * sin) + offset)
    };
    let mesh = Mesh {
        vertices: (0..16).flat_map(layer).collect(),
        triangles: (0..16).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    };
    let bvh = Bvh::build(&mesh.vertices, &mesh.triangles);
    let mut scratch = Scratch::default();
    let mut misled = 0;
    for k in 0..40 {
        let directions: [DVec3; LANES] = std::array::from_fn(|i| {
            (vector(16 * k + i as u64) * DVec3::new(0.3, 0.3, 0.0)) + DVec3::Z
        });
        let ends = [f32::INFINITY; LANES];
        let mut packet = Packet::new(Vec3::ZERO, &directions.map(|d| d.as_vec3()), &ends);
        bvh.nearest(&mut packet, &mut scratch);
        for (lane, &direction) in directions.iter().enumerate() {
            let (nearest, _) = brute(&mesh, DVec3::ZERO, direction).unwrap();
            let found = packet.triangle[lane] == nearest as u32;
            misled += usize::from(!found);
            assert!(found || scratch.rivals.contains(&(lane, nearest as u32)));
        }
    }
    assert!(misled > 10, "f32 was enough: {misled}");
}

#[test]
fn parallel_rays_agree_with_brute_force() {
    let mesh = Mesh {
        vertices: (0..900)
            .map(|i| vector(i / 3) * 100.0 + vector(i + 5000) * 40.0)
            .collect(),
        triangles: (0..300).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    };
    let bvh = Bvh::build(&mesh.vertices, &mesh.triangles);
    let mut scratch = Scratch::default();
    let (mut blocked, mut own) = (0, 0);
    for k in 0..60 {
        let direction = match k {
            0 => DVec3::X,
            1 => DVec3::NEG_Y,
            _ => vector(20_000 + k).normalize(),
        };
        let origins: [DVec3; LANES] =
            std::array::from_fn(|i| vector(30_000 + 100 * k + i as u64) * 110.0);
        let found: [_; LANES] = std::array::from_fn(|i| brute(&mesh, origins[i], direction));
        let ask = |of: &dyn Fn(usize) -> u32, scratch: &mut Scratch| {
            let lanes = std::array::from_fn(|i| {
                let ray = (origins[i].as_vec3(), 1e-3, of(i));
                (i != 3).then_some(ray)
            });
            bvh.blocked_along(Parallel::new(direction.as_vec3(), &lanes), scratch)
        };
        let all = ask(&|_| NO_TRIANGLE, &mut scratch);
        // If the nearest triangle is ignored, the ray is blocked only by surfaces behind it.
        let but_nearest = ask(
            &|i| found[i].map_or(NO_TRIANGLE, |f| f.0 as u32),
            &mut scratch,
        );
        for i in 0..LANES {
            let exact = found[i].is_some() && i != 3;
            assert_eq!(all[i], exact, "{direction} lane {i}");
            blocked += usize::from(exact);
            own += usize::from(exact && !but_nearest[i]);
        }
    }
    assert!(blocked > 200 && own > 50, "{blocked} {own}");
}
