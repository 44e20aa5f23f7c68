//! The schedule of an exposure: which slides each row of the sensor sees, for how long, and where in
//! the mains' period it lies. With a global shutter all rows are as one.
//!
//! A row of a rolling shutter integrates from its own start, so a slide that follows before the last
//! row has ended leaks into the lower rows, in proportion to the time that they share with it.

use super::buffer::GeometryBuffer;
use super::light::{self, Flicker, Indirect, Table};
use super::{Plan, Term};
use crate::emulator::Shot;
use std::ops::Range;
use std::sync::Arc;

/// What a shot exposes the pixels to, ready to be run over chunks of them.
pub(super) struct Schedule {
    /// Of the shot's slide and of those that follow.
    tables: Vec<Arc<Table>>,
    /// What their light does by way of other surfaces; none where the plan leaves it out.
    indirect: Vec<Indirect>,
    when: Timetable,
}

/// Which of a shot's slides each pixel sees, and for how long.
pub(super) struct Timetable {
    /// Pixels that are exposed alike: a row of them, or all.
    pub(super) width: usize,
    pub(super) lines: Vec<Line>,
    pub(super) parts: Vec<Part>,
}

/// Pixels that are exposed alike.
pub(super) struct Line {
    pub(super) parts: Range<usize>,
    /// The exposure in seconds times the mean over it of the pulse of what flickers, where
    /// something does.
    pub(super) swing: Option<f32>,
}

/// One slide in the exposure of a line.
pub(super) struct Part {
    pub(super) table: usize,
    /// Seconds that it is shown, and the projector's light relative to full.
    pub(super) exposure: [f32; 2],
}

impl Timetable {
    /// Of a shot and an image of so many columns and rows.
    pub(super) fn new(
        shot: &Shot,
        plan: &Plan,
        flicker: Option<Flicker>,
        [columns, rows]: [usize; 2],
    ) -> Self {
        let seconds = |ns: u64| (ns as f64 * 1e-9) as f32;
        // Forced in where nothing flickers, it swings by nothing.
        let swing = |start_ns: u64| {
            plan.has(Term::Flicker).then(|| {
                let swing = flicker.map_or(0.0, |f| f.swing(start_ns, shot.exposure_ns));
                swing as f32 * seconds(shot.exposure_ns)
            })
        };
        let power = |place: usize| {
            let (slide, light) = match place {
                0 => (&shot.slide, shot.light),
                _ => (&shot.then[place - 1].slide, shot.then[place - 1].light),
            };
            if slide.is_some() { light as f32 } else { 0.0 }
        };
        let mut when = Self {
            width: columns,
            lines: Vec::new(),
            parts: Vec::new(),
        };
        if !plan.has(Term::RollingShutter) {
            when.width = columns * rows;
            when.parts.push(Part {
                table: 0,
                exposure: [seconds(shot.exposure_ns), power(0)],
            });
            when.lines.push(Line {
                parts: 0..1,
                swing: swing(shot.start_ns),
            });
            return when;
        }
        for row in 0..rows {
            let start_ns = shot.row_start_ns(row as u32);
            let first = when.parts.len();
            when.parts
                .extend(shot.seen(start_ns).map(|(table, ns)| Part {
                    table,
                    exposure: [seconds(ns), power(table)],
                }));
            when.lines.push(Line {
                parts: first..when.parts.len(),
                swing: swing(start_ns),
            });
        }
        when
    }
}

impl Schedule {
    /// Schedules a shot whose slides have these tables.
    pub(super) fn new(
        shot: &Shot,
        tables: Vec<Arc<Table>>,
        plan: &Plan,
        flicker: Option<Flicker>,
        map: &GeometryBuffer,
    ) -> Self {
        let indirect = match plan.has(Term::Interreflection) {
            true => tables
                .iter()
                .map(|t| Indirect::new(&map.bounce, t))
                .collect(),
            false => Vec::new(),
        };
        Self {
            tables,
            indirect,
            when: Timetable::new(shot, plan, flicker, [map.width, map.height]),
        }
    }

    /// Mean electrons of the pixels from `first` on.
    pub(super) fn run(&self, map: &GeometryBuffer, first: usize, electrons: &mut [f32]) {
        self.by_line(first, electrons, |line, from, here| {
            self.line(map, line, from, here);
        });
        self.mixed(map, first, electrons);
        if !self.indirect.is_empty() {
            self.by_line(first, electrons, |line, from, here| {
                for part in &self.when.parts[line.parts.clone()] {
                    let [seconds, light] = part.exposure;
                    self.indirect[part.table].add(&map.bounce, from, seconds * light, here);
                }
            });
        }
    }

    /// Goes through the pixels from `first` on by those that are exposed alike.
    fn by_line(
        &self,
        first: usize,
        electrons: &mut [f32],
        mut run: impl FnMut(&Line, usize, &mut [f32]),
    ) {
        let end = first + electrons.len();
        let mut from = first;
        while from < end {
            let line = from / self.when.width;
            let to = end.min((line + 1) * self.when.width);
            run(
                &self.when.lines[line],
                from,
                &mut electrons[from - first..to - first],
            );
            from = to;
        }
    }

    fn line(&self, map: &GeometryBuffer, line: &Line, first: usize, electrons: &mut [f32]) {
        if let [part] = &self.when.parts[line.parts.clone()] {
            let table = &self.tables[part.table];
            light::run(map, table, part.exposure, line.swing, first, electrons);
            return;
        }
        electrons.fill(0.0);
        let mut share = vec![0.0; electrons.len()];
        for part in &self.when.parts[line.parts.clone()] {
            let table = &self.tables[part.table];
            light::run(map, table, part.exposure, None, first, &mut share);
            for (e, share) in electrons.iter_mut().zip(&share) {
                *e += share;
            }
        }
        if let Some(swing) = line.swing {
            light::add_flicker(map, swing, first, electrons);
        }
    }

    /// The same of the mixed pixels among them.
    fn mixed(&self, map: &GeometryBuffer, first: usize, electrons: &mut [f32]) {
        let end = first + electrons.len();
        let from = map.mixed.partition_point(|m| (m.pixel as usize) < first);
        let mut former = None;
        for (i, mixed) in map.mixed.iter().enumerate().skip(from) {
            let pixel = mixed.pixel as usize;
            if pixel >= end {
                break;
            }
            let here = &mut electrons[pixel - first];
            if former != Some(pixel) {
                *here = 0.0;
            }
            let line = &self.when.lines[pixel / self.when.width];
            let parts = &self.when.parts[line.parts.clone()];
            let steady = parts
                .iter()
                .map(|part| light::mixed(map, i, &self.tables[part.table], part.exposure))
                .sum();
            *here += light::with_flicker(steady, line.swing, mixed.flickering);
            former = Some(pixel);
        }
    }
}
