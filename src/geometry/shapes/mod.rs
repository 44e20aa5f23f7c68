//! Generated shapes as closed meshes: a human torso, a treatment couch and the head of a linear
//! accelerator.
//!
//! Frame: the shape rests on the plane z = 0 and extends towards -z, so a camera looking along +z
//! sees it from above. x runs across, y along; the patient's head is towards -y, which is up in the
//! camera's image. The origin is the centre of the resting plane. The linac head does not rest on
//! anything: its frame is that of the treatment room ([`linac_head()`]).

mod couch;
mod linac_head;
mod loft;
mod torso;

pub use couch::{Couch, couch};
pub use linac_head::linac_head;
pub use torso::{Torso, torso};

/// An invalid shape parameter: the field, its value and the allowed values.
pub type Violation = (&'static str, String, String);

fn within(
    field: &'static str,
    value: f64,
    allowed: std::ops::RangeInclusive<f64>,
) -> Result<(), Violation> {
    // NaN is outside every range.
    if allowed.contains(&value) {
        return Ok(());
    }
    Err((
        field,
        value.to_string(),
        format!("{} to {}", allowed.start(), allowed.end()),
    ))
}

/// Clamps a value to its range; NaN becomes the lower end.
fn clamped(value: f64, allowed: std::ops::RangeInclusive<f64>) -> f64 {
    value.max(*allowed.start()).min(*allowed.end())
}

pub mod check {
    //! Assertions on generated meshes, for tests.

    use crate::Mesh;
    use glam::DVec3;
    use std::collections::HashMap;

    /// Asserts that each edge is used once in each direction, that no triangle is degenerate and
    /// that the volume is positive. Returns the volume in cubic millimetres.
    pub fn closed(mesh: &Mesh) -> f64 {
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        let mut volume = 0.0;
        for (i, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_default() += 1;
            }
            let [p, q, r] = mesh.corners(i);
            let area = (q - p).cross(r - p).length() / 2.0;
            assert!(area > 1e-3, "triangle {i}: {area} mm2");
            volume += p.dot(q.cross(r)) / 6.0;
        }
        for (&(a, b), &count) in &edges {
            assert_eq!((count, edges.get(&(b, a))), (1, Some(&1)), "edge {a} {b}");
        }
        let used: std::collections::HashSet<u32> =
            mesh.triangles.iter().flatten().copied().collect();
        assert_eq!(used.len(), mesh.vertices.len());
        assert!(volume > 0.0);
        volume
    }

    /// Returns the largest angle in degrees between neighbouring triangles, ignoring edges for
    /// which `skip` holds at both ends.
    pub fn sharpest_deg(mesh: &Mesh, skip: impl Fn(DVec3) -> bool) -> f64 {
        let mut normals: HashMap<(u32, u32), DVec3> = HashMap::new();
        for (i, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let [p, q, r] = mesh.corners(i);
            let normal = (q - p).cross(r - p).normalize();
            for edge in [(a, b), (b, c), (c, a)] {
                normals.insert(edge, normal);
            }
        }
        normals
            .iter()
            .filter(|((a, b), _)| {
                !(skip(mesh.vertices[*a as usize]) && skip(mesh.vertices[*b as usize]))
            })
            .map(|(&(a, b), n)| n.dot(normals[&(b, a)]).min(1.0).acos().to_degrees())
            .fold(0.0, f64::max)
    }
}
