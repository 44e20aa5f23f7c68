//! Undetermined motions, described as shifts and turns.

use glam::{DMat3, DVec3};
use nalgebra::{Matrix3xX, Vector6};
use std::fmt;

/// A motion is a shift if its rotation times the spread of the points, per unit of RMS displacement,
/// is less than this.
const SHIFT: f64 = 0.25;

/// A motion that the shape does not determine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Freedom {
    /// A shift.
    Shift {
        /// Unit vector in the room frame.
        along: DVec3,
    },
    /// A turn, possibly combined with a shift along its axis.
    Turn {
        /// Unit vector in the room frame.
        about: DVec3,
        /// A point on the axis, in millimetres.
        through: DVec3,
    },
}

impl Freedom {
    /// Describes the undetermined space spanned by `motions` (shift of `origin` in mm, turn in rad).
    /// `centre` is the mean of the points, `spread` is their RMS distance from this mean, both in mm.
    /// Returns one entry per motion, shifts first, aligned with the room's axes as far as possible.
    pub(super) fn of(
        motions: &[Vector6<f64>],
        origin: DVec3,
        centre: DVec3,
        spread: f64,
    ) -> Vec<Self> {
        if motions.is_empty() {
            return Vec::new();
        }
        let shift_of = |m: &Vector6<f64>| DVec3::new(m[0], m[1], m[2]);
        let turn_of = |m: &Vector6<f64>| DVec3::new(m[3], m[4], m[5]);
        // Orthogonal combinations of the motions; the eigenvalue is the squared rotation.
        let turns = Matrix3xX::from_fn(motions.len(), |i, k| turn_of(&motions[k])[i] * spread);
        let gram = (turns.transpose() * &turns).symmetric_eigen();
        let mut shifts = Vec::new();
        let mut turning = Vec::new();
        for (value, by) in gram.eigenvalues.iter().zip(gram.eigenvectors.column_iter()) {
            let motion: Vector6<f64> = motions.iter().zip(by.iter()).map(|(m, b)| m * *b).sum();
            if value.max(0.0).sqrt() < SHIFT {
                let at_centre = shift_of(&motion) + turn_of(&motion).cross(centre - origin);
                shifts.push(at_centre);
            } else {
                turning.push(motion);
            }
        }
        let mut found: Vec<Self> = along_axes(&shifts)
            .into_iter()
            .map(|along| Self::Shift { along })
            .collect();
        let axes: Vec<DVec3> = turning.iter().map(turn_of).collect();
        for about in along_axes(&axes) {
            let motion = combine(&turning, &axes, about);
            let (turn, at_centre) = (
                turn_of(&motion),
                shift_of(&motion) + turn_of(&motion).cross(centre - origin),
            );
            found.push(Self::Turn {
                about,
                through: centre + turn.cross(at_centre) / turn.length_squared(),
            });
        }
        found
    }
}

/// Orthonormal basis of the span of some vectors, aligned with the coordinate axes as far as
/// possible.
fn along_axes(vectors: &[DVec3]) -> Vec<DVec3> {
    let mut basis: Vec<DVec3> = Vec::new();
    for v in vectors {
        let rest = basis.iter().fold(*v, |v, b| v - *b * b.dot(v));
        basis.extend((rest.length() > 1e-6 * v.length()).then(|| rest.normalize_or_zero()));
    }
    let project = |v: DVec3| basis.iter().map(|b| *b * b.dot(v)).sum::<DVec3>();
    let mut chosen: Vec<DVec3> = Vec::new();
    while chosen.len() < basis.len() {
        let best = DVec3::AXES
            .into_iter()
            .map(|axis| {
                let p = project(axis);
                chosen.iter().fold(p, |p, c| p - *c * c.dot(p))
            })
            .max_by(|a, b| a.length().total_cmp(&b.length()))
            .unwrap_or(DVec3::X);
        chosen.push(best.normalize());
    }
    chosen.sort_by_key(|v| v.abs().max_position());
    chosen
}

/// The combination of motions that turns about `about`, by least squares.
fn combine(motions: &[Vector6<f64>], turns: &[DVec3], about: DVec3) -> Vector6<f64> {
    // Solved on the span of the turns; a small multiple of the identity keeps the matrix invertible.
    let mut outer = DMat3::ZERO;
    for t in turns {
        outer += DMat3::from_cols(*t * t.x, *t * t.y, *t * t.z);
    }
    let largest = outer.x_axis.x + outer.y_axis.y + outer.z_axis.z;
    let regular = outer + DMat3::IDENTITY * (1e-12 * largest);
    let dual = regular.inverse() * about;
    motions
        .iter()
        .zip(turns)
        .map(|(m, t)| m * t.dot(dual))
        .sum()
}

/// Name of the shape that leaves these motions free; `None` if no named shape does.
pub(crate) fn shape(free: &[Freedom]) -> Option<&'static str> {
    let shifts: Vec<DVec3> = free
        .iter()
        .filter_map(|f| match f {
            Freedom::Shift { along } => Some(*along),
            Freedom::Turn { .. } => None,
        })
        .collect();
    let turns: Vec<DVec3> = free
        .iter()
        .filter_map(|f| match f {
            Freedom::Turn { about, .. } => Some(*about),
            Freedom::Shift { .. } => None,
        })
        .collect();
    match (&shifts[..], &turns[..]) {
        ([_, _], [_]) => Some("a plane"),
        ([], [_, _, _]) => Some("a sphere"),
        ([along], [about]) if along.dot(*about).abs() > 0.9 => Some("a cylinder"),
        ([_], []) => Some("an extruded profile"),
        ([], [_]) => Some("a surface of revolution"),
        _ => None,
    }
}

impl fmt::Display for Freedom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let near = |v: &DVec3| {
            let k = v.abs().max_position();
            (v[k].abs() > 0.95).then_some(k)
        };
        match self {
            Self::Shift { along } => match near(along) {
                Some(k) => write!(f, "{} shift", ["LAT", "LNG", "VRT"][k]),
                None => write!(f, "shift along ({along:.2})"),
            },
            Self::Turn { about, through } => {
                match near(about) {
                    Some(k) => write!(f, "{}", ["pitch", "roll", "yaw"][k])?,
                    None => write!(f, "turn about ({about:.2})")?,
                }
                write!(f, " through ({through:.0})")
            }
        }
    }
}
