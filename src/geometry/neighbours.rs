//! Nearest neighbours among points: a balanced k-d tree (J. L. Bentley, 1975) without pointers.
//!
//! A node's range of points is split in the middle, so the tree's shape depends only on the number of
//! points. Only one of several coincident points is kept. If all were kept, they would be equally near,
//! and a query would have to visit each of them to find the lowest indices. Each node has the bounding
//! box of its points: split planes alone do not bound the distance from a point far from the surface.
//!
//! The crate `kiddo` 6.3 is no replacement: it does not specify which of equally near points it
//! returns, adds 13 packages, and takes 0.25 s instead of 0.16 s for nine neighbours of 102,400 points
//! among 307,200 points of a surface (it builds its tree in half the time, 0.05 s).

use glam::DVec3;
use rayon::prelude::*;

/// Maximum number of points in a leaf.
const LEAF: usize = 8;

/// Points and their search tree.
pub struct Neighbours {
    points: Vec<[f32; 3]>,
    ids: Vec<u32>,
    /// Lowest and highest corner of each node's points; the children of i are 2 i + 1 and 2 i + 2.
    boxes: Vec<[[f32; 3]; 2]>,
    /// Number of levels above the leaves.
    levels: u32,
}

impl Neighbours {
    /// Builds a tree of the finite points. Of coincident points, the one with the lowest index is
    /// kept.
    pub fn new(points: &[[f32; 3]]) -> Self {
        let mut all: Vec<([f32; 3], u32)> = points
            .iter()
            .zip(0..)
            .filter(|(p, _)| p.iter().all(|x| x.is_finite()))
            .map(|(&p, i)| (p, i))
            .collect();
        // Adding zero turns -0 into +0.
        all.par_sort_unstable_by_key(|(p, i)| (p.map(|x| (x + 0.0).to_bits()), *i));
        all.dedup_by(|later, first| later.0 == first.0);
        let mut levels = 0;
        while all.len() >> levels > LEAF {
            levels += 1;
        }
        // Level by level: the ranges of a level follow from halving, so no recursion is needed.
        for level in 0..levels {
            let mut ranges: Vec<&mut [([f32; 3], u32)]> = Vec::with_capacity(1 << level);
            let mut rest = all.as_mut_slice();
            let count = rest.len();
            for k in 0..1_usize << level {
                let (start, end) = (start_of(k, level, count), start_of(k + 1, level, count));
                let (head, tail) = rest.split_at_mut(end - start);
                ranges.push(head);
                rest = tail;
            }
            ranges.into_par_iter().enumerate().for_each(|(k, range)| {
                let start = start_of(k, level, count);
                halve(range, start_of(2 * k + 1, level + 1, count) - start);
            });
        }
        let count = all.len();
        let mut boxes = vec![bounds(&[]); (2 << levels) - 1];
        let first = (1 << levels) - 1;
        boxes[first..]
            .par_iter_mut()
            .enumerate()
            .for_each(|(k, of)| {
                *of = bounds(&all[start_of(k, levels, count)..start_of(k + 1, levels, count)]);
            });
        for node in (0..first).rev() {
            let [[a, b], [c, d]] = [boxes[2 * node + 1], boxes[2 * node + 2]];
            boxes[node] = std::array::from_fn(|end| {
                std::array::from_fn(|axis| match end {
                    0 => a[axis].min(c[axis]),
                    _ => b[axis].max(d[axis]),
                })
            });
        }
        Self {
            points: all.iter().map(|(p, _)| *p).collect(),
            ids: all.iter().map(|(_, i)| *i).collect(),
            boxes,
            levels,
        }
    }

    /// Returns the number of points in the tree: finite and distinct points only.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Returns whether the tree is empty.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Returns the `K` points nearest to `p`, nearest first, as (squared distance in square
    /// millimetres, index into the points given); fewer if there are fewer distinct points. Of
    /// points equally far, the lower index comes first.
    pub fn nearest<const K: usize>(&self, p: DVec3) -> Nearest<K> {
        let mut found = Nearest {
            best: [(f64::INFINITY, u32::MAX); K],
        };
        if !self.is_empty() && p.is_finite() {
            self.descend(p, 0, &mut found);
        }
        found
    }

    fn descend<const K: usize>(&self, p: DVec3, node: usize, found: &mut Nearest<K>) {
        let first = (1 << self.levels) - 1;
        if let Some(k) = node.checked_sub(first) {
            let count = self.points.len();
            for i in start_of(k, self.levels, count)..start_of(k + 1, self.levels, count) {
                let q = DVec3::from_array(self.points[i].map(f64::from));
                found.offer((q - p).length_squared(), self.ids[i]);
            }
            return;
        }
        let [a, b] =
            [2 * node + 1, 2 * node + 2].map(|child| (self.distance_squared(p, child), child));
        for (distance, child) in if b.0 < a.0 { [b, a] } else { [a, b] } {
            // Descend at equal distance too, since the child may hold a lower index. Rounding is
            // monotonic, so no point is nearer than its box.
            if distance <= found.best[K - 1].0 {
                self.descend(p, child, found);
            }
        }
    }

    /// Squared distance from a point to a node's box; 0 inside.
    fn distance_squared(&self, p: DVec3, node: usize) -> f64 {
        let [lo, hi] = self.boxes[node].map(|v| DVec3::from_array(v.map(f64::from)));
        (lo - p).max(p - hi).max(DVec3::ZERO).length_squared()
    }
}

/// Start of the `k`-th of 2^level nearly equal ranges of `count` points.
fn start_of(k: usize, level: u32, count: usize) -> usize {
    ((k as u128 * count as u128) >> level) as usize
}

/// Splits a range at index `middle` along its widest axis.
fn halve(range: &mut [([f32; 3], u32)], middle: usize) {
    let [lo, hi] = bounds(range);
    let width = |axis: &usize| f64::from(hi[*axis]) - f64::from(lo[*axis]);
    let axis = (0..3)
        .max_by(|a, b| width(a).total_cmp(&width(b)))
        .unwrap_or(0);
    range.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
}

/// Returns the lowest and highest corner of a range's bounding box.
fn bounds(range: &[([f32; 3], u32)]) -> [[f32; 3]; 2] {
    let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (p, _) in range {
        for axis in 0..3 {
            lo[axis] = lo[axis].min(p[axis]);
            hi[axis] = hi[axis].max(p[axis]);
        }
    }
    [lo, hi]
}

/// Result of [`Neighbours::nearest`].
#[derive(Debug, Clone, Copy)]
pub struct Nearest<const K: usize> {
    best: [(f64, u32); K],
}

impl<const K: usize> Nearest<K> {
    /// Squared distances in square millimetres and indices, nearest first.
    pub fn as_slice(&self) -> &[(f64, u32)] {
        let count = self.best.iter().take_while(|b| b.0.is_finite()).count();
        &self.best[..count]
    }

    fn offer(&mut self, distance: f64, id: u32) {
        let closer = |a: (f64, u32), b: (f64, u32)| a.0 < b.0 || (a.0 == b.0 && a.1 < b.1);
        let new = (distance, id);
        if !closer(new, self.best[K - 1]) {
            return;
        }
        let mut at = K - 1;
        while at > 0 && closer(new, self.best[at - 1]) {
            self.best[at] = self.best[at - 1];
            at -= 1;
        }
        self.best[at] = new;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute(points: &[[f32; 3]], p: DVec3) -> Vec<(f64, u32)> {
        let mut all: Vec<(f64, u32)> = points
            .iter()
            .zip(0..)
            .filter(|(q, _)| q.iter().all(|x| x.is_finite()))
            .filter(|(q, i)| !points[..*i as usize].contains(q))
            .map(|(q, i)| {
                (
                    (DVec3::from_array(q.map(f64::from)) - p).length_squared(),
                    i,
                )
            })
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all.truncate(5);
        all
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn agrees_with_brute_force(
            // A coarse grid gives many ties and coincident points.
            raw in proptest::collection::vec((-4_i8..4, -4_i8..4, -1_i8..1), 0..300),
            at in proptest::array::uniform3(-6.0_f64..6.0),
        ) {
            let mut points: Vec<[f32; 3]> = raw
                .iter()
                .map(|&(x, y, z)| [f32::from(x), f32::from(y), f32::from(z)])
                .collect();
            if points.len() > 3 {
                points[2][1] = f32::NAN;
            }
            let tree = Neighbours::new(&points);
            for p in [DVec3::from_array(at), DVec3::from_array(at).round()] {
                let (found, wanted) = (tree.nearest::<5>(p), brute(&points, p));
                prop_assert_eq!(found.as_slice(), wanted.as_slice());
            }
        }
    }

    #[test]
    fn coincident_points_are_one() {
        let mut points = vec![[1.0, 2.0, 0.0]; 60_000];
        points[7][2] = -0.0;
        points.push([1.0, 2.0, 5.0]);
        let tree = Neighbours::new(&points);
        assert_eq!(tree.len(), 2);
        // One query per point, as for the discs of a cloud, must not take quadratic time.
        for p in &points {
            let found = tree.nearest::<9>(DVec3::from_array(p.map(f64::from)));
            let other = if p[2] > 1.0 { 60_000 } else { 0 };
            assert_eq!(found.as_slice().len(), 2);
            assert_eq!(found.as_slice()[0], (0.0, other));
        }
    }
}
