//! The normal equations of the fit, summed in an order that does not depend on the number of threads.

use super::super::robust::Inflation;
use super::moved::{CHUNK, MOST, Row};
use phasmid_core::statistics::biweight;
use rayon::prelude::*;

/// Sums over rows; w is a row's biweight.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    /// Sum of w / sigma^2 J J^T, lower triangle.
    pub(super) system: [[f64; MOST]; MOST],
    pub(super) right: [f64; MOST],
    pub(super) inflation: Inflation,
    pub(super) count: usize,
    /// Sum of w r^2.
    pub(super) squares_mm2: f64,
    /// Sum of w.
    pub(super) shares: f64,
}

impl Sums {
    fn new() -> Self {
        Self {
            system: [[0.0; MOST]; MOST],
            right: [0.0; MOST],
            inflation: Inflation::default(),
            count: 0,
            squares_mm2: 0.0,
            shares: 0.0,
        }
    }

    /// Sums over all rows; only the first `unknowns` entries of each Jacobian are used.
    pub(super) fn of(rows: &[Row], scale: f64, unknowns: usize) -> Self {
        let parts: Vec<Self> = rows
            .par_chunks(CHUNK)
            .map(|rows| {
                let mut part = Self::new();
                for row in rows.iter().filter(|r| r.counts()) {
                    part.add(row, scale, unknowns);
                }
                part
            })
            .collect();
        let mut sums = Self::new();
        for part in &parts {
            sums.merge(part);
        }
        sums
    }

    fn add(&mut self, row: &Row, scale: f64, unknowns: usize) {
        let whitened = row.residual_mm / row.sigma_mm;
        self.inflation.add(whitened, scale);
        let share = biweight(whitened / scale);
        if share <= 0.0 {
            return;
        }
        let information = share / (row.sigma_mm * row.sigma_mm);
        for a in 0..unknowns {
            let ja = information * row.jacobian[a];
            for b in 0..=a {
                self.system[a][b] += ja * row.jacobian[b];
            }
            self.right[a] += ja * row.residual_mm;
        }
        self.count += 1;
        self.squares_mm2 += share * row.residual_mm * row.residual_mm;
        self.shares += share;
    }

    fn merge(&mut self, other: &Self) {
        let pairs = self.system.as_flattened_mut().iter_mut();
        pairs
            .zip(other.system.as_flattened())
            .for_each(|(a, b)| *a += b);
        for (a, b) in self.right.iter_mut().zip(&other.right) {
            *a += b;
        }
        self.inflation.merge(&other.inflation);
        self.count += other.count;
        self.squares_mm2 += other.squares_mm2;
        self.shares += other.shares;
    }
}
