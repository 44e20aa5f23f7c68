//! A packet of rays with one origin, and their hits so far.

use super::NO_TRIANGLE;
use glam::Vec3;
use phasmid_core::simd::widest;

/// Number of rays in a packet: a tile of 4 x 4 pixels, or the 4 x 4 samples of one pixel.
pub const LANES: usize = 16;

/// Minimum magnitude of a direction component; before the inverse is computed, smaller components are
/// replaced by it.
const SMALLEST: f32 = 1e-30;

/// Returns the smaller number in a single instruction; Rust's `min` has extra code for NaN.
#[inline(always)]
pub(super) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Returns the larger number in a single instruction.
#[inline(always)]
pub(super) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Reduces all lanes pairwise by halves, so that the data stays in SIMD registers.
#[inline(always)]
pub(super) fn reduce(mut lanes: Lanes, combine: impl Fn(f32, f32) -> f32) -> f32 {
    let mut width = LANES / 2;
    while width > 0 {
        for i in 0..width {
            lanes[i] = combine(lanes[i], lanes[i + width]);
        }
        width /= 2;
    }
    lanes[0]
}

/// `reach` of an unused lane, below which no hit minus its error bound can lie.
pub(super) const UNUSED: f32 = f32::NEG_INFINITY;

/// Maximum number of undecided hits of one packet. More occur only with many coincident surfaces,
/// where any hit is equally good.
const MOST_RIVALS: usize = 4096;

/// Working memory shared between casts, and the undecided hits of the last cast.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    /// Nodes to visit, with the parameter at which they are entered.
    pub(super) stack: Vec<(u32, f32)>,
    /// Lane and triangle of hits for which f32 cannot decide on which side of the lane's nearest
    /// hit or end they lie.
    pub rivals: Vec<(usize, u32)>,
}

impl Scratch {
    #[inline(always)]
    pub(super) fn rival(&mut self, lane: usize, triangle: u32) {
        if self.rivals.len() < MOST_RIVALS {
            self.rivals.push((lane, triangle));
        }
    }
}

/// One value per lane.
pub(super) type Lanes = [f32; LANES];

/// Rays from one origin, as a structure of arrays.
///
/// Coordinates are f32 relative to any frame that keeps them small, such as the camera's.
#[derive(Debug, Clone)]
pub struct Packet {
    /// Common origin.
    pub(super) origin: Vec3,
    /// Largest absolute coordinate of the origin; vertices near it have rounding errors of this
    /// scale.
    pub(super) farthest: f32,
    /// Directions, one array per component.
    pub(super) direction: [Lanes; 3],
    /// Inverse of each direction component.
    pub(super) inverse: [Lanes; 3],
    /// Ray parameter of the nearest hit so far, or of the ray's end. Negative: the lane is unused.
    pub t: Lanes,
    /// `t` plus its error bound; triangles and boxes farther away are skipped.
    pub(super) reach: Lanes,
    /// Triangle of the nearest hit so far, or [`NO_TRIANGLE`]. For shadow rays: the triangle that
    /// the lane's ray ignores (the one on which it ends).
    pub triangle: [u32; LANES],
    pub(super) axes: Axes,
    /// Whether all used lanes point sufficiently along the packet's dominant axis for its shear.
    pub(super) coherent: bool,
}

/// A lane is too oblique for the packet's shear if its component along the dominant axis is smaller
/// than this fraction of its largest.
const OBLIQUE: f32 = 0.05;

/// Permutation that maps the packet's dominant axis to z, and the shear of each lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axes {
    pub(super) k: [usize; 3],
    pub(super) shear: [Lanes; 3],
}

impl Packet {
    /// Creates a packet of rays from `origin`; directions need not be of unit length.
    ///
    /// `ends` is each ray's largest parameter: infinite for primary rays, negative for unused
    /// lanes.
    pub fn new(origin: Vec3, directions: &[Vec3; LANES], ends: &Lanes) -> Self {
        new(origin, directions, ends)
    }
}

widest! {
    fn new(origin: Vec3, directions: &[Vec3; LANES], ends: &Lanes) -> Packet => new_body
}
#[inline(always)]
fn new_body(origin: Vec3, directions: &[Vec3; LANES], ends: &Lanes) -> Packet {
    let mut direction = [[0.0f32; LANES]; 3];
    for lane in 0..LANES {
        let [x, y, z] = directions[lane].to_array();
        (direction[0][lane], direction[1][lane], direction[2][lane]) = (x, y, z);
    }
    let mut inverse = [[0.0; LANES]; 3];
    for axis in 0..3 {
        for lane in 0..LANES {
            let d = direction[axis][lane];
            // Keep the inverse finite, so that no product with it is NaN.
            let largest = (1.0 / SMALLEST).copysign(d);
            inverse[axis][lane] = if d.abs() > SMALLEST { 1.0 / d } else { largest };
        }
    }
    let axes = Axes::new(&direction, ends);
    let mut coherent = true;
    let mut reach = *ends;
    for lane in 0..LANES {
        let [x, y, z] = [direction[0][lane], direction[1][lane], direction[2][lane]];
        let largest = max(max(x.abs(), y.abs()), z.abs());
        let along = direction[axes.k[2]][lane].abs();
        coherent &= (ends[lane] < 0.0) | (along >= OBLIQUE * largest);
        reach[lane] = if ends[lane] < 0.0 { UNUSED } else { ends[lane] };
    }
    Packet {
        origin,
        farthest: origin.abs().max_element(),
        axes,
        coherent,
        direction,
        inverse,
        t: *ends,
        reach,
        triangle: [NO_TRIANGLE; LANES],
    }
}

impl Packet {
    /// Returns the packet with one lane's ray in all lanes, and only that lane in use.
    pub(super) fn only(&self, lane: usize) -> Self {
        let mut ends = [-1.0; LANES];
        ends[lane] = self.t[lane];
        let direction = Vec3::from_array(std::array::from_fn(|axis| self.direction[axis][lane]));
        let mut packet = Self::new(self.origin, &[direction; LANES], &ends);
        packet.triangle = self.triangle;
        packet.reach[lane] = self.reach[lane];
        packet
    }
}

impl Axes {
    /// The permuted z is the axis along which the used lanes mainly point. Watertightness only
    /// needs the same shear of a ray for all triangles.
    #[inline(always)]
    fn new(direction: &[Lanes; 3], ends: &Lanes) -> Self {
        let mut weights = [0.0f32; 3];
        for axis in 0..3 {
            let mut used = [0.0; LANES];
            for lane in 0..LANES {
                let length = direction[axis][lane].abs();
                used[lane] = if ends[lane] >= 0.0 { length } else { 0.0 };
            }
            weights[axis] = reduce(used, sum);
        }
        // The last of equal weights.
        let [x, y, z] = weights;
        let kz = match (z >= x && z >= y, y >= x) {
            (true, _) => 2,
            (false, true) => 1,
            (false, false) => 0,
        };
        let k = [(kz + 1) % 3, (kz + 2) % 3, kz];
        let mut shear = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let dz = direction[kz][lane];
            shear[0][lane] = direction[k[0]][lane] / dz;
            shear[1][lane] = direction[k[1]][lane] / dz;
            shear[2][lane] = 1.0 / dz;
        }
        Self { k, shear }
    }
}

#[inline(always)]
fn sum(a: f32, b: f32) -> f32 {
    a + b
}
