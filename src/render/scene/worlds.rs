//! The scene as the rows of a frame see it: all rows at one instant or, with a rolling shutter, each
//! row at its own time.
//!
//! Rigid motion is exact for each row. A deforming mesh takes on one of a few shapes, whose times
//! are spread from the first row to the last.

use super::animation::State;
use super::world::World;
use crate::shot::Shutter;
use phasmid_core::Stop;
use std::borrow::Cow;

/// Side in pixels of the tile that one ray packet covers.
pub(crate) const TILE: usize = 4;
/// Maximum number of shapes that a deforming mesh takes on from the first row to the last.
const MOST_STEPS: usize = 16;
/// Maximum number of deforming triangles, summed over all shapes; each takes about 200 bytes.
const MOST_TRIANGLES: usize = 4_000_000;

/// Time at which the rows of a frame see the scene: one time for all rows, or one per row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Moment {
    /// All rows at one instant.
    Instant(State),
    /// Each row with its own delay.
    Rows(Rows),
}

/// Timing of consecutive rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rows {
    /// Device time of the first row in nanoseconds.
    from_ns: f64,
    shutter: Shutter,
}

impl Moment {
    /// Creates the moment for a frame whose first row is exposed at a device time in nanoseconds.
    pub(crate) fn new(world: &World, from_ns: f64, shutter: Shutter) -> Self {
        let rows = Rows { from_ns, shutter };
        let first = world.state(from_ns);
        let same = |row| world.state(rows.time_ns(row)) == first;
        if shutter.skew_ns() == 0 || (0..shutter.rows).all(|i| same(shutter.first_row + i)) {
            Self::Instant(first)
        } else {
            Self::Rows(rows)
        }
    }
}

impl Rows {
    /// Returns the device time in nanoseconds at which a row sees the scene.
    pub(crate) fn time_ns(&self, row: u32) -> f64 {
        self.from_ns + self.shutter.delay_ns(row) as f64
    }
}

/// The scene as the rows of a frame see it.
pub(crate) struct Worlds {
    /// The scene at one instant, or at a few between the first row and the last.
    steps: Vec<World>,
    rows: Option<Rows>,
    /// Request that ends the passes over the scene early; their output is then invalid.
    pub(crate) stop: Stop,
}

impl Worlds {
    /// Creates a scene that all rows see at one instant.
    pub(crate) fn new(world: World) -> Self {
        Self {
            steps: vec![world],
            rows: None,
            stop: Stop::default(),
        }
    }

    /// Returns the scene at an arbitrary instant, for properties that do not depend on time.
    pub(crate) fn any(&self) -> &World {
        &self.steps[0]
    }

    /// Returns the scene at each instant for which deformed shapes are stored.
    pub(crate) fn steps(&self) -> &[World] {
        &self.steps
    }

    /// Moves the scene to another moment.
    pub(crate) fn set(&mut self, moment: &Moment) {
        match moment {
            Moment::Instant(state) => {
                self.steps.truncate(1);
                self.steps[0].set(state);
                self.rows = None;
            }
            Moment::Rows(rows) => {
                let most = match self.any().deforming_triangles() {
                    0 => 1,
                    triangles => (MOST_TRIANGLES / triangles).clamp(1, MOST_STEPS),
                };
                self.steps.resize(most, self.steps[0].clone());
                let skew_ns = rows.shutter.skew_ns() as f64;
                for (i, world) in self.steps.iter_mut().enumerate() {
                    let share = (i as f64 + 0.5) / most as f64;
                    let state = world.state(rows.from_ns + skew_ns * share);
                    world.set(&state);
                }
                self.rows = Some(*rows);
            }
        }
    }

    /// Returns the number of adjacent rows, at most the side of a tile, that are known to see the
    /// same state.
    pub(crate) fn rows_together(&self) -> usize {
        if self.rows.is_some() { 1 } else { TILE }
    }

    /// Returns the index in [`Self::steps`] of the instant whose shapes a row sees.
    pub(crate) fn step(&self, row: usize) -> usize {
        let Some(Rows { shutter, .. }) = &self.rows else {
            return 0;
        };
        let (delay, skew) = (shutter.delay_ns(row as u32), shutter.skew_ns());
        let step = u128::from(delay) * self.steps.len() as u128 / (u128::from(skew) + 1);
        step as usize
    }

    /// Returns the scene at the time of a row.
    pub(crate) fn at(&self, row: usize) -> Cow<'_, World> {
        let Some(rows) = &self.rows else {
            return Cow::Borrowed(self.any());
        };
        let mut world = self.steps[self.step(row)].clone();
        let state = world.state(rows.time_ns(row as u32));
        world.carry(&state);
        Cow::Owned(world)
    }
}

/// Arrangement of the pixels of a ray packet: a square tile or, if rows are exposed at different
/// times, a segment of a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    /// Base-2 logarithm of the number of columns.
    across: u32,
}

impl Layout {
    /// Returns the layout for packets of `rows` rows, which is the side of a tile or one.
    pub(crate) fn of(rows: usize) -> Self {
        Self {
            across: if rows == TILE { 2 } else { 4 },
        }
    }

    /// Returns the column and row offset of a lane's pixel. Uses no division, whose cost would be
    /// noticeable next to the tracing.
    #[inline(always)]
    pub(crate) fn place(self, lane: usize) -> (usize, usize) {
        (lane & ((1 << self.across) - 1), lane >> self.across)
    }
}
