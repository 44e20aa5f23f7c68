//! The camera's pupil as `aperture.wgsl` reads it: points and turns as tables, so that samples are
//! those of the CPU.

use crate::aperture::Aperture;
use crate::sampled::{pupil_index, turn};
use glam::DVec2;
use phasmid_geometry::raycast::LANES;

/// Points of the pupil for `side` x `side` samples, in their order.
pub(super) fn points(aperture: &Aperture, side: usize) -> impl Iterator<Item = [f32; 2]> {
    let count = side * side;
    (0..count).map(move |k| {
        let point = aperture.point(pupil_index(k, count), count, 0.0);
        point.truncate().as_vec2().to_array()
    })
}

/// Cosine and sine of the turns of all tiles of sixteen pixels, `rows` of which lie together.
pub(super) fn turns(
    (width, height): (usize, usize),
    rows: usize,
) -> impl Iterator<Item = [f32; 2]> {
    let tiles = width.div_ceil(LANES / rows) * height.div_ceil(rows);
    (0..tiles).map(|tile| DVec2::from_angle(turn(tile)).as_vec2().to_array())
}
