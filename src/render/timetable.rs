//! Timetable of an exposure: which patterns each sensor row sees, for how long, how bright, and at
//! which phase of the mains period. With a global shutter all rows are the same.
//!
//! A row of a rolling shutter integrates from its own start, so a pattern that starts before the
//! last row's exposure has ended also reaches the lower rows, in proportion to the time that they
//! share. With pattern timing this applies to all rows. Dark time next to a pattern needs no
//! separate pass, because ambient light is the same in it: its duration is added to the pattern's
//! duration, and the projector light is reduced accordingly.

use super::exposure::Flicker;
use super::{Plan, Term};
use crate::shot::Shot;
use std::ops::Range;

/// The pattern images of a shot that each pixel sees, and for how long it sees each of them.
pub(super) struct Timetable {
    /// Number of adjacent pixels with the same exposure: one row, or all pixels.
    pub(super) width: usize,
    pub(super) lines: Vec<Line>,
    pub(super) parts: Vec<Part>,
    /// Visible pattern images, each given by its index in the shot: 0 is the shot's own pattern
    /// image, higher indices are the pattern images that follow it.
    pub(super) places: Vec<usize>,
}

/// Pixels with the same exposure.
pub(super) struct Line {
    pub(super) parts: Range<usize>,
    /// Exposure time in seconds times the mean of the flicker waveform over the exposure; `None`
    /// without flicker.
    pub(super) swing: Option<f32>,
}

/// Contribution of one pattern image to the exposure of a line.
pub(super) struct Part {
    /// Index of the pattern image among the visible pattern images.
    pub(super) table: usize,
    /// Time in seconds for which the pattern image is seen, and the projector's light during that
    /// time relative to full.
    pub(super) exposure: [f32; 2],
}

/// Index of a pattern image in the shot, the time in nanoseconds for which it is seen, and its mean
/// light during that time.
type Share = (usize, u64, f64);

impl Timetable {
    /// Creates the timetable of a shot for an image of this size.
    pub(super) fn new(
        shot: &Shot,
        plan: &Plan,
        flicker: Option<Flicker>,
        [columns, rows]: [usize; 2],
    ) -> Self {
        let seconds = |ns: u64| (ns as f64 * 1e-9) as f32;
        // If the term is forced although nothing flickers, the flicker amplitude is zero.
        let swing = |start_ns: u64| {
            plan.has(Term::Flicker).then(|| {
                let swing = flicker.map_or(0.0, |f| f.swing(start_ns, shot.exposure_ns));
                swing as f32 * seconds(shot.exposure_ns)
            })
        };
        let rolling = plan.has(Term::RollingShutter);
        let (width, lines) = match rolling {
            true => (columns, rows),
            false => (columns * rows, 1),
        };
        let mut when = Self {
            width,
            lines: Vec::new(),
            parts: Vec::new(),
            places: Vec::new(),
        };
        for row in 0..lines {
            let start_ns = match rolling {
                true => shot.row_start_ns(row as u32),
                false => shot.start_ns,
            };
            let first = when.parts.len();
            for (place, ns, light) in shares(shot, plan, start_ns) {
                let table = when.table(place);
                when.parts.push(Part {
                    table,
                    exposure: [seconds(ns), light as f32],
                });
            }
            when.lines.push(Line {
                parts: first..when.parts.len(),
                swing: swing(start_ns),
            });
        }
        when
    }

    /// Returns the index, among the visible pattern images, of a pattern image of the shot.
    fn table(&mut self, place: usize) -> usize {
        let known = self.places.iter().position(|p| *p == place);
        known.unwrap_or_else(|| {
            self.places.push(place);
            self.places.len() - 1
        })
    }
}

/// Returns the pattern images that a row sees whose exposure starts at `start_ns`.
fn shares(shot: &Shot, plan: &Plan, start_ns: u64) -> Vec<Share> {
    let timed = plan.has(Term::PatternTiming);
    if !timed && !plan.has(Term::RollingShutter) {
        return vec![(0, shot.exposure_ns, light(shot, 0))];
    }
    let seen = shot.seen(start_ns).map(|(place, time)| {
        let light = match &shot.emission {
            Some(emission) if timed && pattern_image(shot, place) => {
                emission.mean(time.start, time.end)
            }
            _ => light(shot, place),
        };
        (place, time.end - time.start, light)
    });
    match timed {
        true => without_darkness(seen.collect()),
        false => seen.collect(),
    }
}

/// Returns whether the shot has a pattern image at an index.
fn pattern_image(shot: &Shot, place: usize) -> bool {
    match place {
        0 => shot.pattern_image.is_some(),
        _ => shot.then[place - 1].pattern_image.is_some(),
    }
}

/// Returns the projector's light at an index of the shot, relative to full current.
fn light(shot: &Shot, place: usize) -> f64 {
    match (pattern_image(shot, place), place) {
        (false, _) => 0.0,
        (true, 0) => shot.light,
        (true, _) => shot.then[place - 1].light,
    }
}

/// Merges the dark time into a lit pattern, or into a single dark entry if no pattern is lit.
fn without_darkness(mut shares: Vec<Share>) -> Vec<Share> {
    let dark_ns: u64 = shares.iter().filter(|s| s.2 == 0.0).map(|s| s.1).sum();
    if shares.iter().any(|(.., light)| *light != 0.0) {
        shares.retain(|(.., light)| *light != 0.0);
    } else {
        shares.truncate(1);
        shares[0].1 = 0;
    }
    if dark_ns > 0 {
        let (_, ns, light) = &mut shares[0];
        *light *= *ns as f64 / (*ns + dark_ns) as f64;
        *ns += dark_ns;
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::led::{Model, Source};
    use crate::{pattern_image::PatternImage, shot::Showing};
    use phasmid_profile::{Droop, Led};
    use std::sync::Arc;

    const MS: u64 = 1_000_000;

    fn plan(terms: &[Term]) -> Plan {
        let mut plan = Plan::default();
        terms.iter().for_each(|term| plan.set(*term, true));
        plan
    }

    fn white(lit: bool) -> Option<Arc<PatternImage>> {
        lit.then(|| Arc::new(PatternImage::Uniform(255)))
    }

    /// Returns a shot with an exposure of 10 ms that sees darkness for 2 ms, a pattern for 5 ms,
    /// darkness again and, from 8 ms on, the pattern (`again`) or darkness.
    fn shot(again: bool) -> Shot {
        let show = |from_ms, lit| Showing {
            from_ns: from_ms * MS,
            pattern_image: white(lit),
            light: 0.8,
        };
        Shot {
            light: 1.0,
            then: vec![show(102, true), show(107, false), show(108, again)],
            start_ns: 100 * MS,
            exposure_ns: 10 * MS,
            ..Shot::default()
        }
    }

    fn table(shot: &Shot, terms: &[Term]) -> (Vec<usize>, Vec<(usize, f32, f32)>) {
        let when = Timetable::new(shot, &plan(terms), None, [4, 3]);
        let parts = when.parts.iter();
        let parts = parts.map(|p| (p.table, p.exposure[0], p.exposure[1]));
        let parts = parts.collect();
        (when.places, parts)
    }

    #[test]
    fn darkness_costs_no_pass() {
        let timed = [Term::PatternTiming];
        assert_eq!(
            table(&shot(false), &timed),
            (vec![1], vec![(0, 0.010, 0.4)])
        );
        let twice = (vec![1, 3], vec![(0, 0.008, 0.5), (1, 0.002, 0.8)]);
        assert_eq!(table(&shot(true), &timed), twice);
        // Darkness alone takes one pass, and so does a single pattern image, unchanged.
        let mut dark = shot(false);
        dark.then[0].pattern_image = None;
        assert_eq!(table(&dark, &timed), (vec![0], vec![(0, 0.010, 0.0)]));
        let single = Shot {
            pattern_image: white(true),
            then: Vec::new(),
            ..shot(false)
        };
        for terms in [
            &timed[..],
            &[],
            &[Term::RollingShutter, Term::PatternTiming],
        ] {
            let (places, parts) = table(&single, terms);
            assert_eq!(places, [0]);
            assert!(parts.iter().all(|part| *part == (0, 0.010, 1.0)));
        }
        // If the plan lacks the term, the rest of the timing is ignored.
        assert_eq!(table(&shot(true), &[]), (vec![0], vec![(0, 0.010, 0.0)]));
    }

    #[test]
    fn each_row_sees_the_source_in_its_own_time() {
        let model = Model::new(&Led {
            rise_us: 700.0,
            droop: vec![Droop {
                time_constant_s: 0.02,
                fraction: 0.4,
            }],
        });
        let mut source = Source::new(model);
        source.drive(101 * MS, 1.0);
        source.drive(106 * MS, 0.5);
        let emission = source.emission(100 * MS);
        let mut shot = Shot {
            emission: Some(emission.clone()),
            ..shot(false)
        };
        shot.shutter.line_time_ns = MS;
        shot.shutter.rows = 3;
        let both = plan(&[Term::RollingShutter, Term::PatternTiming]);
        let when = Timetable::new(&shot, &both, None, [4, 3]);
        assert_eq!((when.width, when.lines.len(), when.parts.len()), (4, 3, 3));
        for part in &when.parts {
            // The pattern ends before the first row's exposure does, and starts when the last row's
            // exposure starts.
            let lit = emission.mean(102 * MS, 107 * MS) * 0.5;
            assert_eq!((part.table, part.exposure), (0, [0.010, lit as f32]));
        }
        shot.shutter.line_time_ns = 3 * MS;
        let when = Timetable::new(&shot, &both, None, [4, 3]);
        let last = emission.mean(106 * MS, 107 * MS) * 0.1;
        assert_eq!(when.parts[2].exposure, [0.010, last as f32]);
        // An exposure of zero length sees the light of its instant, or no light if it is dark.
        let moment = |start_ms| {
            let shot = Shot {
                start_ns: start_ms * MS,
                exposure_ns: 0,
                ..shot.clone()
            };
            table(&shot, &[Term::PatternTiming]).1[0].2
        };
        let light = emission.mean(105 * MS, 105 * MS) as f32;
        assert_eq!((moment(101), moment(105)), (0.0, light));
        assert!(light > 0.8);
    }
}
