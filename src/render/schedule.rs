//! Applies the timetable of an exposure ([`Timetable`]) to pixels: sums the light of the patterns
//! that each sensor row sees, the mains flicker and the indirect light.

use super::exposure::{self, GeometryBuffer, Indirect, Table};
use super::timetable::{Line, Timetable};
use super::{Plan, Term};
use std::sync::Arc;

/// Light of a shot, ready to be applied to chunks of pixels.
pub(super) struct Schedule {
    /// Tables of the visible patterns, numbered as in the timetable.
    tables: Vec<Arc<Table>>,
    /// Indirect light of each visible pattern; empty if the plan does not include it.
    indirect: Vec<Indirect>,
    when: Timetable,
}

/// Light to which a shot exposes the pixels.
pub(super) enum Light {
    /// Schedule that computes the light from the current geometry.
    Scheduled(Schedule),
    /// Mean electrons of the pixels, summed over instants.
    Summed(Vec<f32>),
}

impl Schedule {
    /// Creates the schedule of a timetable; `tables` holds the tables of the timetable's visible
    /// pattern images.
    pub(super) fn new(
        when: Timetable,
        tables: Vec<Arc<Table>>,
        plan: &Plan,
        map: &GeometryBuffer,
    ) -> Self {
        let indirect = match plan.has(Term::Interreflection) {
            true => tables
                .iter()
                .map(|t| Indirect::new(&map.interreflection, t))
                .collect(),
            false => Vec::new(),
        };
        Self {
            tables,
            indirect,
            when,
        }
    }

    /// Computes the mean electrons of the pixels that start at index `first`.
    pub(super) fn run(&self, map: &GeometryBuffer, first: usize, electrons: &mut [f32]) {
        self.by_line(first, electrons, |line, from, here| {
            self.line(map, line, from, here);
        });
        self.mixed(map, first, electrons);
        if !self.indirect.is_empty() {
            self.by_line(first, electrons, |line, from, here| {
                for part in &self.when.parts[line.parts.clone()] {
                    let [seconds, light] = part.exposure;
                    self.indirect[part.table].add(
                        &map.interreflection,
                        from,
                        seconds * light,
                        here,
                    );
                }
            });
        }
    }

    /// Splits the pixels that start at index `first` into ranges with the same exposure. Calls `run`
    /// for each range with its line, first pixel and electrons.
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
            exposure::run(map, table, part.exposure, line.swing, first, electrons);
            return;
        }
        electrons.fill(0.0);
        let mut share = vec![0.0; electrons.len()];
        for part in &self.when.parts[line.parts.clone()] {
            let table = &self.tables[part.table];
            exposure::run(map, table, part.exposure, None, first, &mut share);
            for (e, share) in electrons.iter_mut().zip(&share) {
                *e += share;
            }
        }
        if let Some(swing) = line.swing {
            exposure::add_flicker(map, swing, first, electrons);
        }
    }

    /// Computes the mean electrons of the mixed pixels in the range.
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
                .map(|part| exposure::mixed(map, i, &self.tables[part.table], part.exposure))
                .sum();
            *here += exposure::with_flicker(steady, line.swing, mixed.flickering);
            former = Some(pixel);
        }
    }
}
