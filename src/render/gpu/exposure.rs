//! Exposure pass on the GPU: computes the mean electrons of all pixels from the geometry maps.
//! Equivalent of `schedule.rs`, `timetable.rs` and `exposure/` on the CPU.

use super::engine::Commands;
use super::tables::{Head, Tables};
use super::{Engine, EntryPoint, Shown, grid};
use crate::Term;
use crate::exposure::Bell;
use phasmid_core::error::Result;

/// Number of polynomial pieces of the bell's left half, which is all that `bell.wgsl` needs.
const PIECES: usize = 96;

/// Exposes the camera's pixels to patterns.
#[derive(Default)]
pub(crate) struct Exposure {
    tables: Tables,
    has_bell: bool,
}

impl Exposure {
    /// Adds the passes that write the mean electrons of all pixels to `electrons`.
    ///
    /// The maps and the other buffers that the plan needs must be on the GPU; `mixed_heads` and
    /// related buffers must always be. The schedule is written immediately, so the commands must be
    /// submitted before the next exposure is recorded.
    ///
    /// # Errors
    /// Returns an error if the patterns do not fit in GPU memory or if the GPU has failed.
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
            EntryPoint::new(shader, entry, shown.plan)
                .with("along_rows", flag(heads.iter().any(|head| head.is_row())))
                .with("in_images", flag(heads.iter().any(|head| head.is_image())))
                .with("blur_aspect", shown.blur_aspect)
        };
        let adds = flag(shown.adds);
        engine.run(
            commands,
            &stage("exposure", "main").with("adds", adds),
            grid(shown.pixels),
        )?;
        for entry in ["main", "pixels"] {
            let stage = stage("mixed_exposure", entry).with("adds", adds);
            // The first word of `mixed_count` is the number of heads; the workgroup counts follow at
            // byte 4.
            engine.run_indirect(commands, &stage, "mixed_count", 4)?;
        }
        if shown.plan.has(Term::Interreflection) {
            // Capacity in gather points of 16 bytes each; there may be fewer points.
            let points = engine.size("interreflection_points") / 16 * heads.len() as u64;
            engine.reserve("interreflection_light", 4 * points);
            engine.run(
                commands,
                &stage("indirect", "average"),
                grid(64 * points as usize),
            )?;
            engine.run(commands, &stage("indirect", "spread"), grid(shown.pixels))?;
        }
        Ok(())
    }

    /// Ensures that all buffers that the shaders bind exist; buffers that the plan does not need are
    /// empty.
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

/// Returns the coefficients of the bell's left half, eight numbers per piece.
pub(super) fn bell() -> Vec<[f32; 8]> {
    let eight = |c: &[f64; 6]| std::array::from_fn(|k| c.get(k).map_or(0.0, |&c| c as f32));
    Bell::new().pieces()[..PIECES].iter().map(eight).collect()
}

fn flag(on: bool) -> f64 {
    f64::from(u8::from(on))
}

/// Packs a schedule in the layout of `schedule.wgsl`: two header entries, lines, parts, and two
/// entries per table.
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
