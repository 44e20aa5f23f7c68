//! The 24 parameters of a rig, in a fixed order, and the derivatives of a view's pixel by them.
//!
//! Order: the camera's fx fy cx cy k1 k2 p1 p2 k3 (0 to 8), the projector's (9 to 17), then
//! rotation and translation of the projector in the camera's frame (18 to 23). A rotation step d (a
//! rotation vector about the axes of the camera's frame) changes R to exp(d) R, and R v to
//! R v + d x R v to first order.

use crate::rotation::{difference, nudge};
use crate::{Lens, Rig, View};
use glam::{DMat2, DVec2, DVec3};

/// Number of parameters of a lens.
pub const LENS: usize = 9;
/// Number of parameters of a rig.
pub const RIG: usize = 2 * LENS + 6;

/// Name and unit of each parameter of a rig; coefficients have no unit.
pub const PARAMETERS: [(&str, &str); RIG] = [
    ("camera.fx", "px"),
    ("camera.fy", "px"),
    ("camera.cx", "px"),
    ("camera.cy", "px"),
    ("camera.k1", ""),
    ("camera.k2", ""),
    ("camera.p1", ""),
    ("camera.p2", ""),
    ("camera.k3", ""),
    ("projector.fx", "px"),
    ("projector.fy", "px"),
    ("projector.cx", "px"),
    ("projector.cy", "px"),
    ("projector.k1", ""),
    ("projector.k2", ""),
    ("projector.p1", ""),
    ("projector.p2", ""),
    ("projector.k3", ""),
    ("projector.turn_x", "rad"),
    ("projector.turn_y", "rad"),
    ("projector.turn_z", "rad"),
    ("projector.x", "mm"),
    ("projector.y", "mm"),
    ("projector.z", "mm"),
];

impl Rig {
    /// Returns the rig with a step added to its parameters. The camera's pose is unchanged.
    pub fn stepped(&self, step: &[f64; RIG]) -> Self {
        let camera_from_projector =
            self.camera.rig_from_view.inverse() * self.projector.rig_from_view;
        let [turn, shift] = [18, 21].map(|at| DVec3::from_slice(&step[at..]));
        let moved = nudge(&camera_from_projector, turn, shift);
        Self {
            camera: View {
                lens: self.camera.lens.stepped(&step[..LENS]),
                ..self.camera
            },
            projector: View {
                lens: self.projector.lens.stepped(&step[LENS..2 * LENS]),
                rig_from_view: self.camera.rig_from_view * moved,
            },
            ..*self
        }
    }

    /// Returns the step of the parameters from this rig to another: [`Self::stepped`] by this step gives
    /// the lenses of the other rig, and its projector pose in the camera's frame. The rigs may have
    /// different frames.
    pub fn step_to(&self, other: &Self) -> [f64; RIG] {
        let place = |rig: &Self| rig.camera.rig_from_view.inverse() * rig.projector.rig_from_view;
        let mut step = [0.0; RIG];
        for (at, [own, there]) in [
            (0, [&self.camera.lens, &other.camera.lens]),
            (LENS, [&self.projector.lens, &other.projector.lens]),
        ] {
            let [own, there] = [own, there].map(Lens::parameters);
            for i in 0..LENS {
                step[at + i] = there[i] - own[i];
            }
        }
        step[2 * LENS..].copy_from_slice(&difference(&place(self), &place(other)));
        step
    }
}

impl Lens {
    /// Returns fx fy cx cy k1 k2 p1 p2 k3.
    pub fn parameters(&self) -> [f64; LENS] {
        let (f, c, [k1, k2, p1, p2, k3]) = (self.focal_px, self.principal_px, self.distortion);
        [f.x, f.y, c.x, c.y, k1, k2, p1, p2, k3]
    }

    /// Returns the lens after a step of its parameters, a slice of [`LENS`] numbers.
    pub fn stepped(&self, step: &[f64]) -> Self {
        Self {
            focal_px: self.focal_px + DVec2::new(step[0], step[1]),
            principal_px: self.principal_px + DVec2::new(step[2], step[3]),
            distortion: std::array::from_fn(|i| self.distortion[i] + step[4 + i]),
            ..*self
        }
    }

    /// Returns the pixel of a point in the lens's frame, in mm, with its derivatives, without the
    /// fold check of [`Self::project`]; `None` if the point is not in front of the lens.
    #[doc(hidden)]
    pub fn sight(&self, p: DVec3) -> Option<Sight> {
        if !(p.z > 0.0) {
            return None;
        }
        let ideal = p.truncate() / p.z;
        let (x, y, r2) = (ideal.x, ideal.y, ideal.length_squared());
        let d = self.distort(ideal);
        let f = self.focal_px;
        let by_lens = [
            DVec2::new(d.x, 0.0),
            DVec2::new(0.0, d.y),
            DVec2::X,
            DVec2::Y,
            f * ideal * r2,
            f * ideal * (r2 * r2),
            f * DVec2::new(2.0 * x * y, r2 + 2.0 * y * y),
            f * DVec2::new(r2 + 2.0 * x * x, 2.0 * x * y),
            f * ideal * (r2 * r2 * r2),
        ];
        // Derivative of the normalised image point by the 3D point: [1 0 -x; 0 1 -y] / z.
        let j = DMat2::from_diagonal(f) * self.distort_jacobian(ideal);
        let row = |a: DVec2| DVec3::new(a.x, a.y, -a.dot(ideal)) / p.z;
        Some(Sight {
            px: f * d + self.principal_px,
            by_lens,
            by_point: [row(j.row(0)), row(j.row(1))],
        })
    }
}

/// A pixel and its derivatives.
pub struct Sight {
    /// The pixel.
    pub px: DVec2,
    /// Derivatives by the lens's parameters.
    pub by_lens: [DVec2; LENS],
    /// Derivatives of the pixel's x and y by the point in the lens's frame, in pixels per mm.
    pub by_point: [DVec3; 2],
}

/// Writes the derivatives of a pixel by rotation and translation of a body into six columns. The body
/// carries the point at `arm` from its origin; `by_point` holds the derivatives by the point, in the
/// frame of `arm`. The rotation's derivatives follow from a . (d x arm) = d . (arm x a).
pub fn by_motion(by_point: &[DVec3; 2], arm: DVec3, columns: &mut [DVec2]) {
    let turns = by_point.map(|a| arm.cross(a).to_array());
    let shifts = by_point.map(|a| a.to_array());
    for i in 0..3 {
        columns[i] = DVec2::new(turns[0][i], turns[1][i]);
        columns[3 + i] = DVec2::new(shifts[0][i], shifts[1][i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal;

    #[test]
    fn a_step_leads_from_one_rig_to_another_in_any_frame() {
        let rig = nominal::rig("pmp-real");
        let step = std::array::from_fn(|i| 1e-3 * (i as f64 - 11.5));
        let mut there = rig.stepped(&step);
        let back = rig.step_to(&there);
        for (i, (a, b)) in step.iter().zip(back).enumerate() {
            assert!((a - b).abs() < 1e-10, "{}: {a} {b}", PARAMETERS[i].0);
        }
        // The same rig, expressed in another frame.
        let turned = crate::Pose::from_xyz_deg(DVec3::new(3.0, 1.0, 2.0), DVec3::splat(20.0));
        for view in [&mut there.camera, &mut there.projector] {
            view.rig_from_view = turned * view.rig_from_view;
        }
        for (a, b) in step.iter().zip(rig.step_to(&there)) {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
    }
}
