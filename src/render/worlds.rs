//! The scene as seen by the rows of a frame: all at one instant, or each at its own time with a
//! rolling shutter.
//!
//! Rigid motion is exact for each row. A deforming mesh has one of a few shapes, spread over the
//! time from the first row to the last.

use super::geometry::TILE;
use super::path::State;
use super::world::World;
use crate::shot::Shutter;
use std::borrow::Cow;

/// Shapes of what deforms between the first row and the last.
const MOST_STEPS: usize = 16;
/// Triangles that deform, of all shapes together: about 200 bytes each.
const MOST_TRIANGLES: usize = 4_000_000;

/// Time at which the rows of a frame see the scene.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Moment {
    /// All of them in one state.
    Instant(State),
    /// Each after its delay.
    Rows(Rows),
}

/// Rows that follow each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rows {
    /// Device time of the first row in nanoseconds.
    from_ns: f64,
    shutter: Shutter,
}

impl Moment {
    /// The state of a world for rows of which the first sees it at a device time in nanoseconds.
    pub(super) fn new(world: &World, from_ns: f64, shutter: Shutter) -> Self {
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
    fn time_ns(&self, row: u32) -> f64 {
        self.from_ns + self.shutter.delay_ns(row) as f64
    }
}

/// The scene as it is seen.
pub(super) struct Worlds {
    /// At one instant, or at a few between the first row and the last.
    steps: Vec<World>,
    rows: Option<Rows>,
}

impl Worlds {
    /// The scene at one instant.
    pub(super) fn new(world: World) -> Self {
        Self {
            steps: vec![world],
            rows: None,
        }
    }

    /// The scene at some instant: for what does not depend on it.
    pub(super) fn any(&self) -> &World {
        &self.steps[0]
    }

    /// The scene at the instants that what deforms is kept for.
    pub(super) fn steps(&self) -> &[World] {
        &self.steps
    }

    /// Moves the scene to another moment.
    pub(super) fn set(&mut self, moment: &Moment) {
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

    /// How many rows see the same of it at least, up to the side of a tile.
    pub(super) fn rows_together(&self) -> usize {
        if self.rows.is_some() { 1 } else { TILE }
    }

    /// Which of the steps a row sees the shapes of.
    pub(super) fn step(&self, row: usize) -> usize {
        let Some(Rows { shutter, .. }) = &self.rows else {
            return 0;
        };
        let (delay, skew) = (shutter.delay_ns(row as u32), shutter.skew_ns());
        let step = u128::from(delay) * self.steps.len() as u128 / (u128::from(skew) + 1);
        step as usize
    }

    /// The scene as a row sees it.
    pub(super) fn at(&self, row: usize) -> Cow<'_, World> {
        let Some(rows) = &self.rows else {
            return Cow::Borrowed(self.any());
        };
        let mut world = self.steps[self.step(row)].clone();
        let state = world.state(rows.time_ns(row as u32));
        world.carry(&state);
        Cow::Owned(world)
    }
}
