//! Degenerate meshes: slivers, duplicates, triangles without area, holes.

use super::case::{Case, Group, Sweep};
use super::rays::{EPS, EPS_F32};
use super::scenes::{KEPT, Plane, pixels, scene, small};
use glam::{DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, MeshTree, Pose, ply};
use phasmid_render::Renderer;
use phasmid_render::truth::Truth;
use phasmid_report::lab::Context;

pub(super) const GROUP: Group = Group {
    title: "Meshes",
    sweeps: &[
        Sweep {
            key: "slivers",
            title: "Distance to a sliver triangle of 100 mm, oblique to all axes",
            oracle: "The true distance is a chosen height above the triangle. Its normal is a \
                difference of products as large as its length squared. Allowed: 8 roundings times \
                length and aspect ratio",
            ratio: "aspect ratio",
            error: "distance error in mm",
            rounding: true,
            cases: |_| Ok(slivers()),
        },
        Sweep {
            key: "watertight",
            title: "A plane of strips from 1e-9 to 500 mm wide, rendered at 1000 mm",
            oracle: "Depth in closed form at every pixel, no pixel without a hit. Allowed: 2 \
                roundings of f32. Ratio: aspect ratio of the narrowest strip",
            ratio: "aspect ratio",
            error: "depth error over depth",
            rounding: false,
            cases: strips,
        },
        Sweep {
            key: "twins",
            title: "Duplicate triangles, triangles without area, and holes beside a valid plane",
            oracle: "Closed form of the plane; in a hole, nothing is seen",
            ratio: "triangles",
            error: "depth error over depth",
            rounding: false,
            cases: twins,
        },
        Sweep {
            key: "mesh-limits",
            title: "Invalid meshes",
            oracle: "The mesh must be refused with a message that names the vertex or triangle",
            ratio: "triangles",
            error: "-",
            rounding: false,
            cases: |_| Ok(refused()),
        },
    ],
};

/// Returns the error message of the mesh check.
fn complaint(mesh: Mesh) -> String {
    mesh.checked("mesh.ply")
        .map_or_else(|e| e.to_string(), |_| String::new())
}

fn slivers() -> Vec<Case> {
    let turn = Pose::from_xyz_deg(DVec3::new(3.0, -7.0, 11.0), DVec3::new(31.0, -47.0, 13.0));
    let length = 100.0;
    let one = |aspect: f64| {
        let width = length / aspect;
        let corners = [(0.0, 0.0), (length, 0.0), (length, width), (0.0, width)];
        let mesh = Mesh {
            vertices: corners
                .map(|(x, y)| turn.point(DVec3::new(x, y, 0.0)))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let tree = MeshTree::new(&mesh);
        let mut worst = 0.0_f64;
        for height in [1e-3, 1.0, 50.0] {
            for k in 0..20 {
                let along = length * (f64::from(k) + 0.5) / 20.0;
                let p = turn.point(DVec3::new(along, 0.3 * width, height));
                let found = tree.closest(p).map_or(f64::INFINITY, |c| c.distance_mm);
                worst = worst.max((found - height).abs());
            }
        }
        let allowed = 8.0 * EPS * (length + 50.0) * aspect;
        Case::held(format!("{width} mm wide"), aspect, worst, allowed)
    };
    [1.0, 1e2, 1e4, 1e6, 1e8, 1e10]
        .into_iter()
        .map(one)
        .collect()
}

/// Adds a rectangle in the plane z = 0.
fn rectangle(mesh: &mut Mesh, low: DVec2, high: DVec2) {
    let first = mesh.vertices.len() as u32;
    let corners = [
        low,
        DVec2::new(high.x, low.y),
        high,
        DVec2::new(low.x, high.y),
    ];
    mesh.vertices.extend(corners.map(|c| c.extend(0.0)));
    // Counter-clockwise as seen from -z.
    mesh.triangles
        .extend([[0, 2, 1], [0, 3, 2]].map(|t: [u32; 3]| t.map(|i| first + i)));
}

const HALF_MM: f64 = 500.0;

/// Renders a mesh. Returns the worst relative error of the depth where the plane must be visible, the
/// fraction of those pixels that see it, and the number of pixels that see a surface in a hole.
fn rendered(
    context: &Context<'_>,
    name: &str,
    mesh: &Mesh,
    hole: impl Fn(DVec2) -> Option<bool>,
) -> Result<(f64, f64, usize)> {
    let profile = small()?;
    let path = context.folder.place(&format!("{name}.ply"))?;
    ply::write_mesh(&path, mesh)?;
    let lines = format!(
        "[[object]]\nshape = {{ kind = \"mesh\", file = {:?} }}\nalbedo = 0.5\nposition_mm = [0, 0, 1000]\n\
         rotation_deg = [0, 15, 0]\n",
        std::path::absolute(&path).map_err(|e| Error::io(&path, e))?
    );
    let truth = Renderer::new(&profile, &scene(&lines)?, 1)?.truth(&[]);
    std::fs::remove_file(&path).map_err(|e| Error::io(&path, e))?;
    let plane = Plane {
        profile: &profile,
        z_mm: 1000.0,
        tilt_deg: 15.0,
    };
    let (sin, cos) = 15f64.to_radians().sin_cos();
    let (mut worst, mut seen, mut all, mut ghosts) = (0.0_f64, 0, 0, 0);
    for (i, px) in pixels() {
        let Some(depth) = plane.depth(px) else {
            continue;
        };
        let point = profile.camera.view().lens.ray(px) * depth - DVec3::Z * 1000.0;
        let on_plane = DVec2::new(point.x * cos - point.z * sin, point.y);
        let hit = truth.flags[i] & Truth::SEEN != 0;
        match hole(on_plane) {
            // The pixel is too near the edge of a hole to decide.
            None => {}
            Some(true) => ghosts += usize::from(hit),
            Some(false) => {
                all += 1;
                if hit {
                    seen += 1;
                    worst = worst.max((f64::from(truth.depth_mm[i]) - depth).abs() / depth);
                }
            }
        }
    }
    Ok((worst, f64::from(seen) / f64::from(all.max(1)), ghosts))
}

const ALLOWED: f64 = KEPT * EPS_F32;

fn strips(context: &Context<'_>) -> Result<Vec<Case>> {
    let one = |narrowest: f64| {
        let mut mesh = Mesh::default();
        let mut edge = narrowest;
        rectangle(
            &mut mesh,
            DVec2::new(-edge, -HALF_MM),
            DVec2::new(edge, HALF_MM),
        );
        while edge < HALF_MM {
            let next = (edge * 1.5).min(HALF_MM);
            rectangle(
                &mut mesh,
                DVec2::new(edge, -HALF_MM),
                DVec2::new(next, HALF_MM),
            );
            rectangle(
                &mut mesh,
                DVec2::new(-next, -HALF_MM),
                DVec2::new(-edge, HALF_MM),
            );
            edge = next;
        }
        let count = mesh.triangles.len();
        let name = format!("{narrowest:e} mm, {count} triangles");
        let (worst, seen, _) = rendered(context, &format!("strips-{narrowest:e}"), &mesh, |_| {
            Some(false)
        })?;
        let ratio = 2.0 * HALF_MM / narrowest;
        Ok(Case::held(name, ratio, worst, ALLOWED).kept(seen, 1.0))
    };
    [100.0, 1.0, 1e-3, 1e-6, 1e-9]
        .into_iter()
        .map(one)
        .collect()
}

fn twins(context: &Context<'_>) -> Result<Vec<Case>> {
    let mut clean = Mesh::default();
    rectangle(&mut clean, DVec2::splat(-HALF_MM), DVec2::splat(HALF_MM));
    let mut twins = clean.clone();
    twins.triangles = clean.triangles.repeat(50);
    let mut flat = clean.clone();
    // Triangles with two equal corners, with an edge back and forth, and with collinear corners.
    flat.vertices.push(DVec3::ZERO);
    flat.vertices
        .push(DVec3::new(HALF_MM / 2.0, HALF_MM / 2.0, 0.0));
    flat.triangles
        .extend([[0, 0, 0], [0, 2, 0], [0, 4, 2], [4, 5, 2], [1, 1, 3]]);
    let mut copies = Mesh::default();
    for _ in 0..2 {
        // Duplicate the vertices, so that triangles share positions but not indices.
        rectangle(
            &mut copies,
            DVec2::splat(-HALF_MM),
            DVec2::new(0.0, HALF_MM),
        );
        rectangle(
            &mut copies,
            DVec2::new(0.0, -HALF_MM),
            DVec2::splat(HALF_MM),
        );
    }
    let mut cases = Vec::new();
    for (name, key, mesh) in [
        ("each triangle 50 times", "twins", twins),
        ("triangles of zero area", "flat", flat),
        ("duplicate vertices", "copies", copies),
    ] {
        let (worst, seen, _) = rendered(context, key, &mesh, |_| Some(false))?;
        let ratio = mesh.triangles.len() as f64;
        cases.push(Case::held(name, ratio, worst, ALLOWED).kept(seen, 1.0));
    }
    for (name, key, half) in [
        ("a window of 80 mm", "window", 40.0),
        ("a window of 20 mm", "pane", 10.0),
    ] {
        let mut mesh = Mesh::default();
        for (low, high) in [
            (DVec2::splat(-HALF_MM), DVec2::new(-half, HALF_MM)),
            (DVec2::new(half, -HALF_MM), DVec2::splat(HALF_MM)),
            (DVec2::new(-half, -HALF_MM), DVec2::new(half, -half)),
            (DVec2::new(-half, half), DVec2::new(half, HALF_MM)),
        ] {
            rectangle(&mut mesh, low, high);
        }
        let hole = |p: DVec2| {
            let out = p.abs().max_element() - half;
            (out.abs() > 1e-3).then_some(out < 0.0)
        };
        let (worst, seen, ghosts) = rendered(context, key, &mesh, hole)?;
        let ratio = mesh.triangles.len() as f64;
        let case = Case::held(name, ratio, worst, ALLOWED).kept(seen, 1.0);
        cases.push(if ghosts > 0 {
            Case::failed(
                name,
                ratio,
                &format!("{ghosts} pixels see something in the hole"),
            )
        } else {
            case
        });
    }
    Ok(cases)
}

fn refused() -> Vec<Case> {
    let triangle = |vertex: DVec3| Mesh {
        vertices: vec![DVec3::ZERO, DVec3::X, vertex],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let mut torn = triangle(DVec3::Y);
    torn.triangles.push([0, 1, 3]);
    vec![
        Case::refused(
            "no triangle",
            0.0,
            &complaint(Mesh::default()),
            "no triangle",
        ),
        Case::refused(
            "a NaN vertex",
            1.0,
            &complaint(triangle(DVec3::NAN)),
            "vertex 2",
        ),
        Case::refused(
            "a vertex 1e10 mm away",
            1.0,
            &complaint(triangle(DVec3::X * 1e10)),
            "within",
        ),
        Case::refused("a missing vertex", 2.0, &complaint(torn), "vertices 0 to 2"),
    ]
}
