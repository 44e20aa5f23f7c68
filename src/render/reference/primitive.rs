//! Shapes of the reference renderer in their own frames, each implemented by a method that the
//! production renderer does not use.

use glam::{DVec2, DVec3};

/// A shape of an object, scaled as the object is.
pub(super) enum Primitive {
    /// A mesh, or the faces of a frustum.
    Triangles(Vec<[DVec3; 3]>),
    /// A plane, with half its side lengths.
    Plane(DVec2),
    /// A sphere, with its radius.
    Sphere(f64),
    /// A cylinder along y, with its radius and half its length.
    Cylinder(f64, f64),
}

/// An intersection of a ray with a shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    pub(super) t: f64,
    /// Unit normal of the surface, which may point to either side.
    pub(super) normal: DVec3,
    /// Index of the triangle that was hit, if the shape is a mesh.
    pub(super) triangle: usize,
}

fn met(t: f64, normal: DVec3, triangle: usize) -> Crossing {
    Crossing {
        t,
        normal,
        triangle,
    }
}

impl Primitive {
    /// Returns all intersections with a ray.
    pub(super) fn crossings(&self, o: DVec3, d: DVec3) -> Vec<Crossing> {
        match self {
            Self::Triangles(triangles) => triangles
                .iter()
                .enumerate()
                .filter_map(|(i, t)| moller_trumbore(t, o, d).map(|(t, n)| met(t, n, i)))
                .collect(),
            Self::Plane(half) => {
                let t = -o.z / d.z;
                let p = o + d * t;
                let inside = p.x.abs() <= half.x && p.y.abs() <= half.y;
                if inside && t.is_finite() {
                    vec![met(t, DVec3::NEG_Z, 0)]
                } else {
                    vec![]
                }
            }
            Self::Sphere(r) => quadratic(d.dot(d), 2.0 * o.dot(d), o.dot(o) - r * r)
                .map(|t| met(t, (o + d * t).normalize(), 0))
                .collect(),
            Self::Cylinder(r, half) => {
                let flat = DVec3::new(1.0, 0.0, 1.0);
                let (fo, fd) = (o * flat, d * flat);
                let side = quadratic(fd.dot(fd), 2.0 * fo.dot(fd), fo.dot(fo) - r * r)
                    .map(|t| (t, ((o + d * t) * flat).normalize()))
                    .filter(|(t, _)| (o.y + d.y * t).abs() <= *half);
                let caps = [1.0, -1.0]
                    .map(|s| ((s * half - o.y) / d.y, DVec3::Y * s))
                    .into_iter()
                    .filter(|(t, _)| ((o + d * *t) * flat).length() <= *r);
                side.chain(caps).map(|(t, n)| met(t, n, 0)).collect()
            }
        }
    }
}

fn quadratic(a: f64, b: f64, c: f64) -> impl Iterator<Item = f64> {
    let root = (b * b - 4.0 * a * c).sqrt();
    [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)]
        .into_iter()
        .filter(|t| t.is_finite())
}

fn moller_trumbore([a, b, c]: &[DVec3; 3], o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
    let (e1, e2) = (*b - *a, *c - *a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = o - *a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = d.dot(q) / det;
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    inside.then(|| (e2.dot(q) / det, e1.cross(e2).normalize()))
}

/// Returns the twelve triangles of a frustum, two per face.
pub(super) fn frustum(base: f64, top: f64, height: f64) -> Vec<[DVec3; 3]> {
    let ring = |half: f64, z: f64| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| DVec3::new(x * half, y * half, z))
    };
    let (b, t) = (ring(base, 0.0), ring(top, -height));
    let mut faces = vec![[b[0], b[1], b[2], b[3]], [t[0], t[1], t[2], t[3]]];
    faces.extend((0..4).map(|i| [b[i], b[(i + 1) % 4], t[(i + 1) % 4], t[i]]));
    faces
        .into_iter()
        .flat_map(|[p, q, r, s]| [[p, q, r], [p, r, s]])
        .collect()
}
