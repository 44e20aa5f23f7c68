//! Detects edges of surfaces, and of the light on them, between neighbouring points of the camera's
//! image.

use super::input::Input;
use super::rays::Rays;
use crate::exposure::GeometryBuffer;
use crate::material::COS_CREASE;
use crate::scene::{Surface, World};
use crate::truth::Truth;
use crate::{Plan, Term};
use glam::Vec3;
use phasmid_core::simd::widest;

/// Number of pixels compared at a time.
const LANES: usize = 8;

/// A surface point that a ray hits, prepared for the test whether this point and another belong to
/// the same smooth surface in the same light.
#[derive(Clone, Copy)]
pub(super) struct Place {
    surface: u32,
    /// Number of the mesh; a surface that is not a triangle has a number of its own.
    mesh: u32,
    lit: u32,
    /// Bit mask of the lamps that light the point.
    lamps: u32,
    normal: Vec3,
    direction: Vec3,
    depth: f32,
    /// Length of the ray's direction vector.
    length: f32,
    /// Distance of the tangent plane from the camera, which is negative.
    plane: f32,
}

impl Place {
    pub(super) fn new(
        world: &World,
        surface: Surface,
        (lit, lamps): (bool, u32),
        normal: Vec3,
        direction: Vec3,
        depth: f32,
    ) -> Self {
        /// Set for surfaces that are not triangles.
        const ALONE: u32 = 1 << 31;
        let mesh = match surface != Surface::NONE && world.is_triangle(surface) {
            true => u32::from(world.object(surface)),
            false => surface.0 | ALONE,
        };
        Self {
            surface: surface.0,
            mesh,
            lit: lit.into(),
            lamps,
            normal,
            direction,
            depth,
            length: direction.length(),
            plane: normal.dot(direction) * depth,
        }
    }

    /// Returns whether an edge of the surface or of the light on it lies between this point and
    /// another. Two points of one mesh are separated by a crease, or if one is farther from the
    /// tangent plane of the other than a pixel's size on the surface. `pixel_slope` is the width of
    /// a pixel at unit depth.
    #[inline(always)]
    pub(super) fn is_apart(&self, other: &Self, pixel_slope: f32) -> bool {
        let facing = self.normal.dot(other.direction);
        let predicted = self.plane / facing;
        let cos = -facing / other.length;
        let cos = if cos > 0.05 { cos } else { 0.05 };
        let near = (predicted - other.depth).abs() <= self.depth * pixel_slope / cos;
        let smooth =
            near & (self.normal.dot(other.normal) >= COS_CREASE) & (self.mesh == other.mesh);
        (self.lit != other.lit)
            | (self.lamps != other.lamps)
            | ((self.surface != other.surface) & !smooth)
    }
}

/// The surface points at the centres of a row's pixels, with a copy of the first point before them
/// and copies of the last point after them.
#[derive(Clone, Default)]
struct Row {
    row: Option<usize>,
    words: [Vec<u32>; 4],
    numbers: [Vec<f32>; 9],
}

/// Consecutive surface points of a row.
struct Block {
    words: [[u32; LANES]; 4],
    numbers: [[f32; LANES]; 9],
}

impl Row {
    fn fill(
        &mut self,
        map: &GeometryBuffer,
        world: &World,
        rays: &Rays<'_>,
        plan: &Plan,
        row: usize,
    ) {
        if self.row == Some(row) {
            return;
        }
        self.row = Some(row);
        let lights = plan.has(Term::Lights);
        let padded = map.width.next_multiple_of(LANES) + 2;
        self.words
            .iter_mut()
            .for_each(|words| words.resize(padded, 0));
        self.numbers
            .iter_mut()
            .for_each(|numbers| numbers.resize(padded, 0.0));
        for k in 0..padded {
            let column = k.saturating_sub(1).min(map.width - 1);
            let i = row * map.width + column;
            let light = (
                map.flags[i] & Truth::LIT != 0,
                if lights { map.lamps[i] } else { 0 },
            );
            let place = Place::new(
                world,
                Surface(map.surface[i]),
                light,
                Vec3::from_array(map.normal[i]),
                rays.center(column, row).as_vec3(),
                map.depth[i],
            );
            let words = [place.surface, place.mesh, place.lit, place.lamps];
            for (to, word) in self.words.iter_mut().zip(words) {
                to[k] = word;
            }
            let ([a, b, c], [d, e, f]) = (place.normal.to_array(), place.direction.to_array());
            let numbers = [a, b, c, d, e, f, place.depth, place.length, place.plane];
            for (to, number) in self.numbers.iter_mut().zip(numbers) {
                to[k] = number;
            }
        }
    }

    #[inline(always)]
    fn block(&self, from: usize) -> Block {
        let mut block = Block {
            words: [[0; LANES]; 4],
            numbers: [[0.0; LANES]; 9],
        };
        for (to, words) in block.words.iter_mut().zip(&self.words) {
            to.copy_from_slice(&words[from..from + LANES]);
        }
        for (to, numbers) in block.numbers.iter_mut().zip(&self.numbers) {
            to.copy_from_slice(&numbers[from..from + LANES]);
        }
        block
    }
}

impl Block {
    #[inline(always)]
    fn place(&self, k: usize) -> Place {
        let n = &self.numbers;
        Place {
            surface: self.words[0][k],
            mesh: self.words[1][k],
            lit: self.words[2][k],
            lamps: self.words[3][k],
            normal: Vec3::new(n[0][k], n[1][k], n[2][k]),
            direction: Vec3::new(n[3][k], n[4][k], n[5][k]),
            depth: n[6][k],
            length: n[7][k],
            plane: n[8][k],
        }
    }
}

/// Compares the pixels of rows with their neighbours; keeps the last rows that it has read.
#[derive(Default)]
pub(super) struct Neighbours {
    rows: [Row; 3],
    apart: Vec<u32>,
}

impl Neighbours {
    /// Returns for each pixel of a row whether an edge lies between its centre and the centre of one
    /// of its eight neighbours; 0 if not.
    pub(super) fn apart(
        &mut self,
        input: &Input<'_>,
        world: &World,
        map: &GeometryBuffer,
        row: usize,
        pixel_slope: f32,
    ) -> &[u32] {
        let near = [row.saturating_sub(1), row, (row + 1).min(map.height - 1)];
        for row in near {
            self.rows[row % 3].fill(map, world, input.rays, input.plan, row);
        }
        self.apart.clear();
        self.apart.resize(map.width.next_multiple_of(LANES), 0);
        compare(
            near.map(|row| &self.rows[row % 3]),
            pixel_slope,
            &mut self.apart,
        );
        &self.apart[..map.width]
    }
}

widest! {
    fn compare(rows: [&Row; 3], pixel_slope: f32, apart: &mut [u32]) => compare_body
}
#[inline(always)]
fn compare_body(rows: [&Row; 3], pixel_slope: f32, apart: &mut [u32]) {
    for (i, apart) in apart.chunks_exact_mut(LANES).enumerate() {
        let from = i * LANES;
        if !differ(rows, from) {
            continue;
        }
        let here = rows[1].block(from + 1);
        for row in rows {
            for shift in 0..3 {
                let there = row.block(from + shift);
                for k in 0..LANES {
                    apart[k] |= u32::from(here.place(k).is_apart(&there.place(k), pixel_slope));
                }
            }
        }
    }
}

/// Returns whether a block of pixels and their neighbours see more than one surface, or one surface in
/// different light. Between equal places lies no edge.
#[inline(always)]
fn differ(rows: [&Row; 3], from: usize) -> bool {
    /// Indices in [`Row::words`] of the surface, of the projector's light and of the lamps.
    const COMPARED: [usize; 3] = [0, 2, 3];
    let mut bits = 0;
    for word in COMPARED {
        let here = rows[1].words[word][from];
        for row in rows {
            for other in &row.words[word][from..from + LANES + 2] {
                bits |= here ^ other;
            }
        }
    }
    bits != 0
}
