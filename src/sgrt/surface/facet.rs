//! A triangle with normals at its corners: its closest point in barycentric coordinates, and the
//! feature (inside, edge or corner) that contains it.

use glam::{DVec3, Vec3};

/// A triangle in the form that the search uses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    pub(super) corners: [DVec3; 3],
    /// Unit normals of the smooth surface at the corners. f32 suffices: an error of 1e-7 changes the
    /// weight of a residual, it does not create one.
    pub(super) normals: [Vec3; 3],
}

/// The feature of a triangle that contains the closest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Feature {
    Inside,
    /// On the edge from corner k to corner k + 1.
    Edge(usize),
    Corner(usize),
}

/// The closest point of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    pub(super) point: DVec3,
    pub(super) weights: [f64; 3],
    pub(super) feature: Feature,
    pub(super) distance_squared: f64,
}

impl Facet {
    /// Computes the closest point by Voronoi regions (C. Ericson, "Real-Time Collision Detection",
    /// 2005, section 5.1.5). The triangle must not be degenerate.
    #[inline]
    pub(super) fn nearest(&self, p: DVec3) -> Nearest {
        let [a, b, c] = self.corners;
        let (ab, ac, ap) = (b - a, c - a, p - a);
        let (d1, d2) = (ab.dot(ap), ac.dot(ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return self.at(p, [1.0, 0.0, 0.0], Feature::Corner(0));
        }
        let bp = p - b;
        let (d3, d4) = (ab.dot(bp), ac.dot(bp));
        if d3 >= 0.0 && d4 <= d3 {
            return self.at(p, [0.0, 1.0, 0.0], Feature::Corner(1));
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            let v = d1 / (d1 - d3);
            return self.at(p, [1.0 - v, v, 0.0], Feature::Edge(0));
        }
        let cp = p - c;
        let (d5, d6) = (ab.dot(cp), ac.dot(cp));
        if d6 >= 0.0 && d5 <= d6 {
            return self.at(p, [0.0, 0.0, 1.0], Feature::Corner(2));
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            let w = d2 / (d2 - d6);
            return self.at(p, [1.0 - w, 0.0, w], Feature::Edge(2));
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
            let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
            return self.at(p, [0.0, 1.0 - w, w], Feature::Edge(1));
        }
        let scale = 1.0 / (va + vb + vc);
        let (v, w) = (vb * scale, vc * scale);
        self.at(p, [1.0 - v - w, v, w], Feature::Inside)
    }

    #[inline]
    fn at(&self, p: DVec3, weights: [f64; 3], feature: Feature) -> Nearest {
        let [a, b, c] = self.corners;
        let point = a * weights[0] + b * weights[1] + c * weights[2];
        Nearest {
            point,
            weights,
            feature,
            distance_squared: (p - point).length_squared(),
        }
    }

    /// The smooth surface's unit normal at barycentric coordinates `weights`.
    #[inline]
    pub(super) fn normal(&self, weights: [f64; 3]) -> DVec3 {
        let [a, b, c] = self.normals.map(|n| n.as_dvec3());
        (a * weights[0] + b * weights[1] + c * weights[2]).normalize_or_zero()
    }
}
