//! The exposure pass on the GPU: mean electrons of all pixels from the maps of the geometry pass.
//! Twin of `schedule.rs`, `timetable.rs` and of `light`.

use super::engine::Commands;
use super::tables::{Head, Tables};
use super::{Engine, Stage, grid};
use crate::light::{Bell, Table};
use crate::timetable::Timetable;
use crate::{Plan, Term};
use phasmid_core::error::Result;
use std::sync::Arc;

/// Pieces of the bell's left half, which is enough for `bell.wgsl`.
const PIECES: usize = 96;

/// Exposes pixels to slides.
#[derive(Default)]
pub(crate) struct Exposure {
    tables: Tables,
    has_bell: bool,
}

/// What a shot exposes the pixels to.
pub(crate) struct Shown<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) when: &'a Timetable,
    /// Of the slides that are seen, as the timetable counts them.
    pub(crate) tables: &'a [Arc<Table>],
    /// Pixels of the image.
    pub(crate) pixels: usize,
    /// Whether the light joins what `electrons` holds: that of another instant of the exposure.
    pub(crate) adds: bool,
}

impl Exposure {
    /// Adds the passes that leave the mean electrons of all pixels in `electrons`.
    ///
    /// The maps, and what the plan asks for beside them, are at hand: `mixed_heads` and so on always.
    /// The schedule is written at once, so that the commands must be submitted before the next
    /// exposure is asked for.
    ///
    /// # Errors
    /// Slides that the GPU has no memory for, or a GPU that has failed.
    pub(crate) fn run(
        &mut self,
        engine: &mut Engine,
        commands: &mut Commands,
        shown: &Shown<'_>,
    ) -> Result<()> {
        let heads = self.tables.place(engine, shown.tables)?;
        engine.write("schedule", bytemuck::cast_slice(&packed(shown, &heads)));
        self.provide(engine, shown.pixels);
        let stage = |shader, entry| {
            Stage::new(shader, entry, shown.plan)
                .with("along_rows", flag(heads.iter().any(|head| head.is_row())))
                .with(
                    "in_pictures",
                    flag(heads.iter().any(|head| head.is_picture())),
                )
        };
        let adds = flag(shown.adds);
        engine.run(
            commands,
            &stage("exposure", "main").with("adds", adds),
            grid(shown.pixels),
        )?;
        for entry in ["main", "pixels"] {
            let stage = stage("mixed_exposure", entry).with("adds", adds);
            // The first word is the number of heads, the others are groups of threads.
            engine.run_indirect(commands, &stage, "mixed_count", 4)?;
        }
        if shown.plan.has(Term::Interreflection) {
            // Room for so many points, of 16 bytes each; there may be fewer.
            let points = engine.size("bounce_points") / 16 * heads.len() as u64;
            engine.reserve("bounce_light", 4 * points);
            engine.run(
                commands,
                &stage("indirect", "average"),
                grid(64 * points as usize),
            )?;
            engine.run(commands, &stage("indirect", "spread"), grid(shown.pixels))?;
        }
        Ok(())
    }

    /// Sees that all buffers are there that the shaders name: those that the plan leaves out hold
    /// nothing.
    fn provide(&mut self, engine: &mut Engine, pixels: usize) {
        engine.reserve("electrons", 4 * pixels as u64);
        // A head takes 16 bytes.
        let heads = engine.size("mixed_heads") / 16;
        engine.reserve("mixed_electrons", 4 * heads);
        for name in ["under_skin", "mixed_skin", "mixtures"] {
            engine.provide(name);
        }
        if !self.has_bell {
            engine.write("bell", bytemuck::cast_slice(&bell()));
            self.has_bell = true;
        }
    }
}

/// Coefficients of the bell's left half, eight numbers a piece.
pub(super) fn bell() -> Vec<[f32; 8]> {
    let eight = |c: &[f64; 6]| std::array::from_fn(|k| c.get(k).map_or(0.0, |&c| c as f32));
    Bell::new().pieces()[..PIECES].iter().map(eight).collect()
}

fn flag(on: bool) -> f64 {
    f64::from(u8::from(on))
}

/// A schedule as `schedule.wgsl` has it: a head of two, lines, parts, and two for each table.
pub(super) fn packed(shown: &Shown<'_>, heads: &[Head]) -> Vec<[u32; 4]> {
    let when = shown.when;
    let parts = 2 + when.lines.len() as u32;
    let tables = parts + when.parts.len() as u32;
    let mut words = vec![
        [shown.pixels as u32, when.width as u32, parts, tables],
        [heads.len() as u32, 0, 0, 0],
    ];
    words.extend(when.lines.iter().map(|line| {
        let swing = line.swing.unwrap_or(0.0);
        [
            line.parts.start as u32,
            line.parts.len() as u32,
            swing.to_bits(),
            0,
        ]
    }));
    words.extend(when.parts.iter().map(|part| {
        let [seconds, light] = part.exposure;
        [part.table as u32, seconds.to_bits(), light.to_bits(), 0]
    }));
    words.extend(heads.iter().flat_map(|head| head.words()));
    words
}
