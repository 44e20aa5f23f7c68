//! The normal equations of a pose, summed in an order that does not depend on the number of threads.

use super::super::robust::Inflation;
use super::rows::{CHUNK, Row};
use glam::DVec3;
use nalgebra::{Matrix6, Matrix6x3, Vector6};
use phasmid_core::statistics::biweight;
use rayon::prelude::*;

/// Sums over rows, each weighted by its biweight w and its variance.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    /// Information: sum of w / sigma^2 J J^T.
    pub(super) system: Matrix6<f64>,
    pub(super) right: Vector6<f64>,
    /// Sum of w / sigma^2, in 1/mm^2.
    pub(super) weight: f64,
    /// Sum of w r^2.
    pub(super) squares_mm2: f64,
    /// Sum of w.
    pub(super) shares: f64,
    /// Number of rows with non-zero weight.
    pub(super) count: usize,
    pub(super) levers: DVec3,
    /// Sums of products of a lever's coordinates: xx, yy, zz, xy, xz, yz.
    products: [f64; 6],
    pub(super) inflation: Inflation,
    /// Sum of w / sigma^2 J n^T for each pod: the effect of a common offset of the pod's points.
    pub(super) pods: Vec<Matrix6x3<f64>>,
}

impl Sums {
    fn new(pods: usize) -> Self {
        Self {
            system: Matrix6::zeros(),
            right: Vector6::zeros(),
            weight: 0.0,
            squares_mm2: 0.0,
            shares: 0.0,
            count: 0,
            levers: DVec3::ZERO,
            products: [0.0; 6],
            inflation: Inflation::default(),
            pods: vec![Matrix6x3::zeros(); pods],
        }
    }

    /// Sums over all rows; residuals outside the biweight of this scale have no weight.
    pub(super) fn of(rows: &[Row], scale: f64, pods: usize) -> Self {
        let parts: Vec<Self> = rows
            .par_chunks(CHUNK)
            .map(|rows| {
                let mut part = Self::new(pods);
                for row in rows {
                    part.add(row, scale);
                }
                part
            })
            .collect();
        let mut sums = Self::new(pods);
        for part in parts {
            sums.merge(&part);
        }
        sums
    }

    fn add(&mut self, row: &Row, scale: f64) {
        if !row.counts() {
            return;
        }
        let whitened = row.whitened();
        self.inflation.add(whitened, scale);
        let share = biweight(whitened / scale);
        if share <= 0.0 {
            return;
        }
        let information = share / (row.sigma_mm * row.sigma_mm);
        let j = row.jacobian();
        for a in 0..6 {
            let ja = information * j[a];
            // Lower triangle only; [`Self::information`] mirrors it.
            for b in 0..=a {
                self.system[(a, b)] += ja * j[b];
            }
            self.right[a] += ja * row.residual_mm;
            let pod = &mut self.pods[usize::from(row.pod)];
            for (b, n) in row.normal.to_array().into_iter().enumerate() {
                pod[(a, b)] += ja * n;
            }
        }
        self.weight += information;
        self.squares_mm2 += share * row.residual_mm * row.residual_mm;
        self.shares += share;
        self.count += 1;
        let l = row.lever;
        self.levers += l;
        let [xx, yy, zz] = (l * l).to_array();
        let products = [xx, yy, zz, l.x * l.y, l.x * l.z, l.y * l.z];
        for (sum, product) in self.products.iter_mut().zip(products) {
            *sum += product;
        }
    }

    fn merge(&mut self, other: &Self) {
        self.system += other.system;
        self.right += other.right;
        self.weight += other.weight;
        self.squares_mm2 += other.squares_mm2;
        self.shares += other.shares;
        self.count += other.count;
        self.levers += other.levers;
        for (a, b) in self.products.iter_mut().zip(&other.products) {
            *a += b;
        }
        self.inflation.merge(&other.inflation);
        for (a, b) in self.pods.iter_mut().zip(&other.pods) {
            *a += b;
        }
    }

    /// The full information matrix.
    pub(super) fn information(&self) -> Matrix6<f64> {
        let mut full = self.system;
        full.fill_upper_triangle_with_lower_triangle();
        full
    }

    /// The metric of motions: x^T M x is the mean square displacement, in mm^2, of the points with
    /// non-zero weight under the shift and turn x.
    pub(super) fn metric(&self) -> Matrix6<f64> {
        let n = self.count.max(1) as f64;
        let l = self.levers / n;
        let [xx, yy, zz, xy, xz, yz] = self.products.map(|p| p / n);
        let mut m = Matrix6::identity();
        // Off-diagonal blocks, from 2 turn . (lever x shift): the cross-product matrix of the mean
        // lever.
        let cross = [[0.0, -l.z, l.y], [l.z, 0.0, -l.x], [-l.y, l.x, 0.0]];
        for a in 0..3 {
            for b in 0..3 {
                m[(3 + a, b)] = cross[a][b];
                m[(b, 3 + a)] = cross[a][b];
            }
        }
        let turns = [
            [yy + zz, -xy, -xz],
            [-xy, xx + zz, -yz],
            [-xz, -yz, xx + yy],
        ];
        for a in 0..3 {
            for b in 0..3 {
                m[(3 + a, 3 + b)] = turns[a][b];
            }
        }
        m
    }
}
