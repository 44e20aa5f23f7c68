//! Pass 3: triangulates coordinates to depth, row by row.

use super::BAND;
use crate::maps::{AxisMap, Decoded};
use crate::rows::triangulate_row;
use crate::triangulate::{CoordinateRow, Triangulator};
use rayon::prelude::*;

/// Writes the depth maps from the axes whose fringe order is resolved.
pub(super) fn triangulate(triangulator: &Triangulator, out: &mut Decoded) {
    let width = out.width;
    let resolved =
        |map: &Option<AxisMap>| map.as_ref().filter(|m| m.wrapped_px.is_none()).is_some();
    let (use_x, use_y) = (resolved(&out.x), resolved(&out.y));
    let (x, y) = (&out.x, &out.y);
    out.depth
        .par_chunks_mut(width)
        .zip(out.depth_sigma.par_chunks_mut(width))
        .enumerate()
        .with_min_len(BAND)
        .for_each(|(v, (depth, sigma))| {
            let at = v * width..(v + 1) * width;
            let used = [(x, use_x), (y, use_y)].map(|(map, on)| map.as_ref().filter(|_| on));
            let all = used.map(|map| map.map(|map| map.uncertainties(at.clone())));
            let [x, y] = std::array::from_fn(|k| {
                Some(CoordinateRow {
                    px: &used[k]?.coordinate[at.clone()],
                    sigma: all[k].as_ref()?,
                })
            });
            triangulate_row(triangulator, v, x, y, depth, sigma);
        });
}
