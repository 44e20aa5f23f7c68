//! Converts the bitmap to vertices and triangles, parallel over slices.

use super::bits::{Bits, ragged};
use super::table::{TRIANGLES, edge};
use crate::volume::Volume;
use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_geometry::Mesh;
use rayon::prelude::*;

const MOST_VERTICES: u64 = 1 << 26;

/// Minimum distance of a vertex from a voxel's centre, as a fraction of the voxel distance.
const LEAST: f64 = 1e-3;

/// Returns the surface around the set bits.
pub(super) fn mesh(volume: &Volume, level: f64, bits: &Bits, place: &str) -> Result<Mesh> {
    let [_, nj, nk] = bits.size;
    let starts = starts(bits, place)?;
    let vertices: Vec<Vec<DVec3>> = (0..nk)
        .into_par_iter()
        .map(|k| slice_vertices(volume, level, bits, k))
        .collect();
    let mirrored = volume.grid().direction.determinant() < 0.0;
    let triangles: Vec<Vec<[u32; 3]>> = (0..nk - 1)
        .into_par_iter()
        .map(|k| {
            let mut triangles = Vec::new();
            for j in 0..nj - 1 {
                row_triangles(bits, &starts, [j, k], &mut triangles);
            }
            if mirrored {
                triangles
                    .iter_mut()
                    .for_each(|t: &mut [u32; 3]| t.swap(1, 2));
            }
            triangles
        })
        .collect();
    Ok(Mesh {
        vertices: vertices.concat(),
        triangles: triangles.concat(),
        ..Mesh::default()
    })
}

/// Returns one word of the mask of edges that start in a row, run along an axis and cross the
/// surface.
fn crossed(bits: &Bits, j: usize, k: usize, axis: usize, word: usize) -> u64 {
    let here = bits.row(j, k)[word];
    match axis {
        0 => here ^ after(bits.row(j, k), word),
        1 if j + 1 < bits.size[1] => here ^ bits.row(j + 1, k)[word],
        2 if k + 1 < bits.size[2] => here ^ bits.row(j, k + 1)[word],
        _ => 0,
    }
}

/// Returns a word of a row shifted by one bit, so that each bit lines up with its neighbour.
fn after(row: &[u64], word: usize) -> u64 {
    row[word] >> 1 | row.get(word + 1).map_or(0, |next| next << 63)
}

/// Returns, for each row, the index of the first vertex on the edges along each axis.
fn starts(bits: &Bits, place: &str) -> Result<Vec<[u32; 3]>> {
    let [_, nj, nk] = bits.size;
    let mut starts: Vec<[u32; 3]> = (0..nj * nk)
        .into_par_iter()
        .map(|row| {
            [0, 1, 2].map(|axis| {
                let words = 0..bits.words;
                let crossed = words.map(|w| crossed(bits, row % nj, row / nj, axis, w));
                crossed.map(u64::count_ones).sum()
            })
        })
        .collect();
    let mut sum = 0_u64;
    for row in &mut starts {
        for count in row {
            let start = sum;
            sum += u64::from(*count);
            // Overflowing values are never used, see the check below.
            *count = start as u32;
        }
    }
    if sum > MOST_VERTICES {
        return Err(ragged(format!("{sum} vertices"), place));
    }
    Ok(starts)
}

/// Returns the vertices on edges that start in a slice, in the order of [`starts`].
fn slice_vertices(volume: &Volume, level: f64, bits: &Bits, k: usize) -> Vec<DVec3> {
    let mut vertices = Vec::new();
    for j in 0..bits.size[1] {
        for axis in 0..3 {
            for word in 0..bits.words {
                let mut rest = crossed(bits, j, k, axis, word);
                while rest != 0 {
                    let i = 64 * word + rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    vertices.push(vertex(volume, level, [i, j, k], axis));
                }
            }
        }
    }
    vertices
}

/// Returns the vertex on a crossing edge that starts at a voxel (coordinates include the border)
/// and runs along an axis.
fn vertex(volume: &Volume, level: f64, at: [usize; 3], axis: usize) -> DVec3 {
    let grid = volume.grid();
    let number = |at: [usize; 3]| {
        let inner = (0..3).all(|a| (1..=grid.size[a]).contains(&at[a]));
        inner.then(|| f64::from(volume.voxels().get(grid.offset(at.map(|x| x - 1)))))
    };
    let mut end = at;
    end[axis] += 1;
    // Edges to the border are cut at the outer faces of the voxels.
    let part = match (number(at), number(end)) {
        (Some(a), Some(b)) => ((level - a) / (b - a)).clamp(LEAST, 1.0 - LEAST),
        _ => 0.5,
    };
    let mut index = DVec3::from_array(at.map(|x| x as f64 - 1.0));
    index[axis] += part;
    grid.point(index)
}

/// Rows of edges of a row of cells: axis, and row offset relative to the cells' row.
const EDGE_ROWS: [(usize, usize, usize); 8] = [
    (0, 0, 0),
    (0, 1, 0),
    (0, 0, 1),
    (0, 1, 1),
    (1, 0, 0),
    (1, 0, 1),
    (2, 0, 0),
    (2, 1, 0),
];

/// Appends the triangles of a row of cells.
fn row_triangles(bits: &Bits, starts: &[[u32; 3]], [j, k]: [usize; 2], to: &mut Vec<[u32; 3]>) {
    let rows = [
        bits.row(j, k),
        bits.row(j + 1, k),
        bits.row(j, k + 1),
        bits.row(j + 1, k + 1),
    ];
    // Number of vertices before the current word in each row of edges.
    let mut before = EDGE_ROWS.map(|(axis, dj, dk)| starts[j + dj + bits.size[1] * (k + dk)][axis]);
    for word in 0..bits.words {
        let corners = rows.map(|row| [row[word], after(row, word)]);
        let all = corners.iter().fold(u64::MAX, |a, [p, q]| a & p & q);
        let any = corners.iter().fold(0, |a, [p, q]| a | p | q);
        let mut active = any & !all;
        let edges = EDGE_ROWS.map(|(axis, dj, dk)| crossed(bits, j + dj, k + dk, axis, word));
        while active != 0 {
            let bit = active.trailing_zeros();
            active &= active - 1;
            let mut inside = 0;
            for corner in 0..8 {
                let set = corners[corner >> 1][corner & 1] >> bit & 1;
                inside |= (set as usize) << corner;
            }
            let below = (1_u64 << bit) - 1;
            let number = |row: usize, below: u64| before[row] + (edges[row] & below).count_ones();
            // Edges along j and k exist at both ends of the cell.
            let ends = [below, below << 1 | 1];
            let mut numbers = [0; 12];
            for corner in 0..8 {
                let (bi, bj, bk) = (corner & 1, corner >> 1 & 1, corner >> 2);
                if bi == 0 {
                    numbers[edge(corner, 0)] = number(bj + 2 * bk, below);
                }
                if bj == 0 {
                    numbers[edge(corner, 1)] = number(4 + bk, ends[bi]);
                }
                if bk == 0 {
                    numbers[edge(corner, 2)] = number(6 + bj, ends[bi]);
                }
            }
            let triangles = TRIANGLES[inside].iter();
            to.extend(triangles.map(|t| t.map(|edge| numbers[edge as usize])));
        }
        for (count, edges) in before.iter_mut().zip(edges) {
            *count += edges.count_ones();
        }
    }
}
