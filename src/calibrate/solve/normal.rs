//! Normal equations of bundle adjustment, with the board poses eliminated.
//!
//! The matrix is [U V; V' W], where W is block diagonal with a 6 x 6 block per board. The Schur
//! complement U - V W^-1 V' has only the rig's unknowns (Triggs et al., "Bundle adjustment: a modern
//! synthesis", 2000, section 6.1). The inverse of the whole matrix is the covariance of all
//! unknowns.

use super::model::{ALL, State, linearise};
use super::observation::PoseObservations;
use super::robust::Loss;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, MatrixXx6, Vector6};
use phasmid_geometry::parameters::RIG;
use rayon::prelude::*;

/// The normal equations at a state.
#[derive(Clone)]
pub(super) struct Normal {
    /// Loss at the state. For the squared loss it is twice the negative log-likelihood, up to a
    /// constant.
    pub loss: f64,
    boards: Vec<Board>,
}

#[derive(Clone)]
struct Board {
    loss: f64,
    matrix: Box<[[f64; ALL]; ALL]>,
    right: [f64; ALL],
}

/// Which of the rig's unknowns are free.
pub(super) type Free = [bool; RIG];

/// A step of all unknowns.
pub(super) struct Step {
    pub rig: [f64; RIG],
    pub boards: Vec<[f64; 6]>,
    /// Squared length of the step in standard deviations.
    pub length: f64,
}

impl Normal {
    /// Sets up the equations at a state. Returns `None` if a point is behind a lens or the loss is
    /// not finite.
    pub fn at(poses: &[PoseObservations], state: &State, loss: &Loss) -> Option<Self> {
        let boards: Vec<Board> = (0..poses.len())
            .into_par_iter()
            .map(|i| Board::at(&poses[i], state, i, loss))
            .collect::<Option<_>>()?;
        let sum: f64 = boards.iter().map(|b| b.loss).sum();
        sum.is_finite().then_some(Self { loss: sum, boards })
    }

    /// Step that minimises the linearised loss, with the diagonal scaled by 1 + `damping`
    /// (Marquardt). Returns `None` if the free unknowns are not determined.
    pub fn step(&self, free: &Free, damping: f64) -> Option<Step> {
        let reduced = Reduced::new(self, free, damping)?;
        let rig_step = reduced.schur.solve(&reduced.right);
        let mut rig = [0.0; RIG];
        for (i, at) in reduced.columns.iter().enumerate() {
            rig[*at] = rig_step[i];
        }
        let mut boards = Vec::with_capacity(self.boards.len());
        for (own, elimination) in self.boards.iter().zip(&reduced.boards) {
            let right = Vector6::from_fn(|i, _| own.right[RIG + i]);
            let step = elimination.inverse * right - elimination.carry.transpose() * &rig_step;
            boards.push(std::array::from_fn(|i| step[i]));
        }
        let mut step = Step {
            rig,
            boards,
            length: 0.0,
        };
        step.length = self.square(&step);
        step.length.is_finite().then_some(step)
    }

    /// Squared length of the step in the metric of the normal matrix.
    fn square(&self, step: &Step) -> f64 {
        let mut sum = 0.0;
        for (own, board) in self.boards.iter().zip(&step.boards) {
            let all: [f64; ALL] =
                std::array::from_fn(|i| if i < RIG { step.rig[i] } else { board[i - RIG] });
            for (row, a) in own.matrix.iter().zip(&all) {
                sum += a * row.iter().zip(&all).map(|(m, b)| m * b).sum::<f64>();
            }
        }
        sum
    }

    /// Inverse of the normal matrix: the rig's free unknowns, then six unknowns per board. Returns
    /// `None` if the matrix is singular.
    pub fn covariance(&self, free: &Free) -> Option<DMatrix<f64>> {
        let reduced = Reduced::new(self, free, 0.0)?;
        let rig = reduced.schur.inverse();
        let count = reduced.columns.len();
        let mut all = DMatrix::zeros(count + 6 * self.boards.len(), count + 6 * self.boards.len());
        all.view_mut((0, 0), (count, count)).copy_from(&rig);
        let carried: Vec<MatrixXx6<f64>> = reduced.boards.iter().map(|b| &rig * &b.carry).collect();
        for (i, own) in reduced.boards.iter().enumerate() {
            let at = count + 6 * i;
            let across = -&carried[i];
            all.view_mut((0, at), (count, 6)).copy_from(&across);
            all.view_mut((at, 0), (6, count))
                .copy_from(&across.transpose());
            for (j, other) in carried.iter().enumerate() {
                let mut block = own.carry.transpose() * other;
                if i == j {
                    block += own.inverse;
                }
                all.view_mut((at, count + 6 * j), (6, 6)).copy_from(&block);
            }
        }
        all.iter().all(|x| x.is_finite()).then_some(all)
    }
}

impl Board {
    fn at(pose: &PoseObservations, state: &State, board: usize, loss: &Loss) -> Option<Self> {
        let mut all = Self {
            loss: 0.0,
            matrix: Box::new([[0.0; ALL]; ALL]),
            right: [0.0; ALL],
        };
        for o in pose
            .points
            .iter()
            .filter(|o| o.camera_counts || o.projector_counts)
        {
            let (residual, slopes) = linearise(o, state, board)?;
            let camera = o.camera_counts.then_some((residual.camera, &slopes.camera));
            let projector = residual.projector.filter(|_| o.projector_counts);
            let projector = projector.map(|r| (r, &slopes.projector));
            for (group, part) in [camera, projector].into_iter().enumerate() {
                let Some((r, rows)) = part else { continue };
                let (value, weight) = loss.of(group, r.length_squared());
                all.loss += value;
                all.add(weight, rows, [r.x, r.y]);
            }
        }
        for i in 1..ALL {
            for j in 0..i {
                all.matrix[i][j] = all.matrix[j][i];
            }
        }
        Some(all)
    }

    fn add(&mut self, weight: f64, rows: &[[f64; ALL]; 2], r: [f64; 2]) {
        let [a, b] = rows;
        for i in 0..ALL {
            let (wa, wb) = (weight * a[i], weight * b[i]);
            if wa == 0.0 && wb == 0.0 {
                continue;
            }
            // Only the upper triangle is accumulated; `Board::at` mirrors it.
            for (m, (x, y)) in self.matrix[i][i..]
                .iter_mut()
                .zip(a[i..].iter().zip(&b[i..]))
            {
                *m += wa * x + wb * y;
            }
            self.right[i] += wa * r[0] + wb * r[1];
        }
    }
}

/// The equations reduced to the rig's free unknowns.
struct Reduced {
    /// Indices of the free unknowns.
    columns: Vec<usize>,
    schur: Cholesky<f64, Dyn>,
    right: DVector<f64>,
    boards: Vec<Elimination>,
}

struct Elimination {
    /// W^-1.
    inverse: Matrix6<f64>,
    /// V W^-1; each row belongs to one of the rig's free unknowns.
    carry: MatrixXx6<f64>,
}

impl Reduced {
    fn new(normal: &Normal, free: &Free, damping: f64) -> Option<Self> {
        let columns: Vec<usize> = (0..RIG).filter(|i| free[*i]).collect();
        let count = columns.len();
        let raised = |i: usize, j: usize| if i == j { 1.0 + damping } else { 1.0 };
        let mut schur = DMatrix::<f64>::zeros(count, count);
        let mut right = DVector::zeros(count);
        let mut boards = Vec::with_capacity(normal.boards.len());
        for b in &normal.boards {
            let w = Matrix6::from_fn(|i, j| b.matrix[RIG + i][RIG + j] * raised(i, j));
            let inverse = w.cholesky()?.inverse();
            let v = MatrixXx6::from_fn(count, |i, j| b.matrix[columns[i]][RIG + j]);
            let carry = &v * inverse;
            let own = DVector::from_fn(6, |i, _| b.right[RIG + i]);
            schur += DMatrix::from_fn(count, count, |i, j| {
                b.matrix[columns[i]][columns[j]] * raised(i, j)
            });
            schur -= &carry * v.transpose();
            right += DVector::from_fn(count, |i, _| b.right[columns[i]]) - &carry * own;
            boards.push(Elimination { inverse, carry });
        }
        // Make the matrix exactly symmetric despite rounding.
        let schur = (&schur + schur.transpose()) * 0.5;
        Some(Self {
            columns,
            schur: schur.cholesky()?,
            right,
            boards,
        })
    }
}
