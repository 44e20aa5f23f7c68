//! Pattern tables in GPU memory, all in one buffer.
//!
//! The CPU computes the tables (`exposure/`) and caches the latest ones; this cache uses less
//! memory. When the tables no longer fit, all are evicted and the tables in use are uploaded again,
//! so a sequence whose tables fit is uploaded once.

use super::Engine;
use crate::exposure::{HeldRow, ImageTable, RowTable, Table};
use phasmid_core::error::{Error, Result};
use phasmid_pattern::Axis;
use std::sync::{Arc, Weak};

/// Name of the buffer, which is declared in `pattern_images.wgsl`.
const NAME: &str = "pattern_image_cells";
/// Bytes per cell, the unit in which the buffer is allocated.
const CELL: u64 = 16;
/// Maximum memory for tables in bytes, if the GPU allows buffers of that size.
const MOST_BYTES: u64 = 256 << 20;
/// Minimum capacity of the buffer in cells.
const LEAST: u64 = 1 << 16;

const UNIFORM: u32 = 0;
const ALONG_X: u32 = 1;
const ALONG_Y: u32 = 2;
const IMAGE: u32 = 3;

/// Header of a table: twin of `Table` in `pattern_images.wgsl`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Head {
    kind: u32,
    first: u32,
    size: [u32; 2],
    scale: f32,
    long: bool,
    held: u32,
}

impl Head {
    /// Returns the header in the layout of `schedule.wgsl`.
    pub(super) fn words(self) -> [[u32; 4]; 2] {
        let [width, height] = self.size;
        let long = u32::from(self.long);
        [
            [self.kind, self.first, width, height],
            [self.scale.to_bits(), long, self.held, 0],
        ]
    }

    pub(super) fn is_row(self) -> bool {
        [ALONG_X, ALONG_Y].contains(&self.kind)
    }

    pub(super) fn is_image(self) -> bool {
        self.kind == IMAGE
    }
}

/// Tables in GPU memory and their offsets.
pub(super) struct Tables {
    placed: Vec<(Weak<Table>, Head)>,
    /// Cells in use, and capacity in cells.
    used: u64,
    room: u64,
    /// Maximum size of the buffer in bytes.
    most: u64,
}

impl Default for Tables {
    fn default() -> Self {
        Self::within(MOST_BYTES)
    }
}

impl Tables {
    /// Creates a cache of at most `most` bytes.
    pub(super) fn within(most: u64) -> Self {
        Self {
            placed: Vec::new(),
            used: 0,
            room: 0,
            most,
        }
    }

    /// Uploads those tables of an exposure that are not on the GPU yet.
    ///
    /// # Errors
    /// Returns an error if the tables of the exposure do not fit at the same time.
    pub(super) fn place(
        &mut self,
        engine: &mut Engine,
        tables: &[Arc<Table>],
    ) -> Result<Vec<Head>> {
        self.placed.retain(|(table, _)| table.strong_count() > 0);
        let missing = |placed: &Self| -> u64 {
            let mut cells = 0;
            for (i, table) in tables.iter().enumerate() {
                let is_first = !tables[..i].iter().any(|t| Arc::ptr_eq(t, table));
                if is_first && placed.find(table).is_none() {
                    cells += cells_of(table);
                }
            }
            cells
        };
        if self.used + missing(self) > self.room {
            let all = self.used + missing(self);
            (self.placed, self.used) = (Vec::new(), 0);
            let (most, needed) = (
                engine.gpu().largest_buffer().min(self.most) / CELL,
                missing(self),
            );
            if needed > most {
                let (needed, most) = (needed * CELL, most * CELL);
                return Err(Error::device(format!(
                    "the patterns of one exposure take {needed} bytes of GPU memory, expected at \
                     most {most}"
                )));
            }
            let wanted = if all <= most { all } else { needed };
            if wanted > self.room {
                self.room = wanted.next_power_of_two().max(LEAST).min(most);
            }
        }
        // This call has no effect if the capacity suffices.
        engine.reserve(NAME, self.room.max(1) * CELL);
        tables
            .iter()
            .map(|table| Ok(self.put(engine, table)))
            .collect()
    }

    fn find(&self, table: &Arc<Table>) -> Option<Head> {
        let same = |(placed, _): &&(Weak<Table>, Head)| placed.as_ptr() == Arc::as_ptr(table);
        self.placed.iter().find(same).map(|(_, head)| *head)
    }

    fn put(&mut self, engine: &mut Engine, table: &Arc<Table>) -> Head {
        if let Some(head) = self.find(table) {
            return head;
        }
        let (cells, mut head) = packed(table);
        (head.first, head.held) = (self.used as u32, head.held + self.used as u32);
        engine.write_at(NAME, self.used * CELL, bytemuck::cast_slice(&cells));
        self.used += cells.len() as u64;
        self.placed.push((Arc::downgrade(table), head));
        head
    }
}

/// Returns the size of a table in cells.
fn cells_of(table: &Table) -> u64 {
    match table {
        Table::Uniform(_) => 0,
        Table::Row(_, row, held) => {
            (row.words().len()
                + held
                    .as_ref()
                    .map_or(0, |held| held_words(held).len().div_ceil(4))) as u64
        }
        Table::Image(image) => {
            let words = image.sums().len() * if is_long(image) { 2 } else { 1 };
            words.div_ceil(4) as u64
        }
    }
}

/// Returns the cells of a table and its header, whose offsets are relative to the first cell.
fn packed(table: &Table) -> (Vec<[u32; 4]>, Head) {
    match table {
        Table::Uniform(level) => (
            Vec::new(),
            Head {
                kind: UNIFORM,
                scale: *level,
                ..Head::default()
            },
        ),
        Table::Row(axis, row, held) => {
            let (mut cells, mut head) = packed_row(row);
            head.kind = match axis {
                Axis::X => ALONG_X,
                Axis::Y => ALONG_Y,
            };
            head.held = cells.len() as u32;
            if let Some(held) = held {
                cells.extend(in_cells(&held_words(held)));
            }
            (cells, head)
        }
        Table::Image(image) => packed_image(image),
    }
}

fn packed_row(row: &RowTable) -> (Vec<[u32; 4]>, Head) {
    let cells: Vec<_> = row.words().collect();
    let head = Head {
        size: [cells.len() as u32, 1],
        scale: row.scale(),
        long: row.is_long(),
        ..Head::default()
    };
    (cells, head)
}

/// Returns the light of each pixel, then the mean light of each group of 2, of 4 and so on, preceded
/// by the offset in words at which each of these lists starts.
fn held_words(held: &HeldRow) -> Vec<u32> {
    let groupings = held.groupings();
    let mut words = Vec::new();
    let mut start = groupings.len();
    for grouping in groupings {
        words.push(start as u32);
        start += grouping.len();
    }
    words.extend(groupings.iter().flatten().map(|light| light.to_bits()));
    words
}

/// Returns whether sums over the pattern image exceed one word.
fn is_long(image: &ImageTable) -> bool {
    image
        .sums()
        .last()
        .is_some_and(|&all| all > f64::from(u32::MAX))
}

fn packed_image(image: &ImageTable) -> (Vec<[u32; 4]>, Head) {
    let long = is_long(image);
    let words: Vec<u32> = match long {
        true => {
            let both = |&sum: &f64| [sum as u64 as u32, (sum as u64 >> 32) as u32];
            image.sums().iter().flat_map(both).collect()
        }
        false => image.sums().iter().map(|&sum| sum as u32).collect(),
    };
    let head = Head {
        kind: IMAGE,
        size: image.size().map(|side| side as u32),
        scale: image.scale(),
        long,
        ..Head::default()
    };
    (in_cells(&words), head)
}

fn in_cells(words: &[u32]) -> Vec<[u32; 4]> {
    let cell = |words: &[u32]| std::array::from_fn(|k| words.get(k).copied().unwrap_or(0));
    words.chunks(4).map(cell).collect()
}
