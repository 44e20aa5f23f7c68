//! Arranges linked corners into grids, each with its own numbering.

use super::links::Links;
use super::saddles::Saddle;
use std::collections::{BTreeMap, VecDeque};

/// Saddle indices by (row, column), written (y, x). The axes x and y follow two of the edges'
/// directions, with y clockwise of x.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) at: BTreeMap<[i32; 2], usize>,
    /// Whether the square between -x and -y of the corner (0, 0) is dark.
    pub(super) dark: bool,
    /// Number of links that contradict the grid: two positions for one corner, or two corners at
    /// one position.
    pub(super) conflicts: usize,
}

impl Grid {
    /// First column and row, and the number of columns and rows.
    pub(super) fn bounds(&self) -> ([i32; 2], [u32; 2]) {
        let mut low = [i32::MAX; 2];
        let mut high = [i32::MIN; 2];
        for [y, x] in self.at.keys() {
            low = [low[0].min(*x), low[1].min(*y)];
            high = [high[0].max(*x), high[1].max(*y)];
        }
        if self.at.is_empty() {
            return ([0; 2], [0; 2]);
        }
        let size = [0, 1].map(|i| (high[i] - low[i]) as u32 + 1);
        (low, size)
    }
}

/// Builds the grids of an image, the one with the most corners first.
pub(super) fn grids(saddles: &[Saddle], links: &Links) -> Vec<Grid> {
    // Position and rotation of each saddle. The saddle's edge k points in direction k + rotation
    // (modulo 4) of the grid, counted as x, y, -x, -y.
    let mut placed: Vec<Option<([i32; 2], usize)>> = vec![None; saddles.len()];
    let mut grids = Vec::new();
    for seed in 0..saddles.len() {
        if placed[seed].is_some() {
            continue;
        }
        placed[seed] = Some(([0, 0], 0));
        // The sector after edge 0 is dark: between x and y and, opposite, between -x and -y.
        let mut grid = Grid {
            at: BTreeMap::from([([0, 0], seed)]),
            dark: true,
            conflicts: 0,
        };
        let mut queue = VecDeque::from([seed]);
        while let Some(from) = queue.pop_front() {
            let Some(([y, x], turn)) = placed[from] else {
                continue;
            };
            for (edge, link) in links[from].iter().enumerate() {
                let Some((to, back)) = *link else { continue };
                let direction = (edge + turn) % 4;
                let [dy, dx] = [[0, 1], [1, 0], [0, -1], [-1, 0]][direction];
                let place = ([y + dy, x + dx], (direction + 6 - back) % 4);
                match placed[to] {
                    Some(other) => grid.conflicts += usize::from(other != place),
                    None if grid.at.contains_key(&place.0) => grid.conflicts += 1,
                    None => {
                        placed[to] = Some(place);
                        grid.at.insert(place.0, to);
                        queue.push_back(to);
                    }
                }
            }
        }
        grids.push(grid);
    }
    grids.sort_by_key(|g| std::cmp::Reverse(g.at.len()));
    grids
}
