//! Trilinear interpolation between the eight voxels around an index.

use super::Grid;
use glam::DVec3;

/// Offsets and weights of eight voxels; the weights sum to one.
pub(super) struct Cell {
    pub(super) offsets: [usize; 8],
    pub(super) weights: [f64; 8],
}

/// Returns the cell of an index, clamped to the outermost centres. NaN counts as the first voxel.
pub(super) fn cell(grid: &Grid, index: DVec3) -> Cell {
    let mut low = [0_usize; 3];
    let mut step = [0_usize; 3];
    let mut part = [0.0_f64; 3];
    let strides = [1, grid.size[0], grid.size[0] * grid.size[1]];
    for axis in 0..3 {
        let last = grid.size[axis] - 1;
        // `max` returns 0 if the index is NaN.
        let x = index[axis].max(0.0).min(last as f64);
        // The last centre belongs to the cell before it.
        low[axis] = (x as usize).min(last.saturating_sub(1));
        part[axis] = x - low[axis] as f64;
        step[axis] = if last == 0 { 0 } else { strides[axis] };
    }
    let first = low[0] + grid.size[0] * (low[1] + grid.size[1] * low[2]);
    let mut cell = Cell {
        offsets: [first; 8],
        weights: [1.0; 8],
    };
    for corner in 0..8 {
        for axis in 0..3 {
            let upper = corner >> axis & 1 == 1;
            cell.offsets[corner] += if upper { step[axis] } else { 0 };
            cell.weights[corner] *= if upper { part[axis] } else { 1.0 - part[axis] };
        }
    }
    cell
}
