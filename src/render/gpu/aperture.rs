//! Tables of pupil points and rotations for `aperture.wgsl`, so that the samples match the CPU's.

use crate::transport::{Aperture, pupil_index, turn};
use glam::DVec2;
use phasmid_geometry::raycast::LANES;

/// Returns the pupil points for `side` x `side` samples, in sample order.
pub(super) fn points(aperture: &Aperture, side: usize) -> impl Iterator<Item = [f32; 2]> {
    let count = side * side;
    (0..count).map(move |k| {
        let point = aperture.point(pupil_index(k, count), count, 0.0);
        point.truncate().as_vec2().to_array()
    })
}

/// Returns cosine and sine of the rotation of each tile of sixteen pixels; `rows` rows share a
/// packet.
pub(super) fn turns(
    (width, height): (usize, usize),
    rows: usize,
) -> impl Iterator<Item = [f32; 2]> {
    let tiles = width.div_ceil(LANES / rows) * height.div_ceil(rows);
    (0..tiles).map(|tile| DVec2::from_angle(turn(tile)).as_vec2().to_array())
}
