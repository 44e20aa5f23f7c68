//! The projector's output over time: patterns, each shown for its exposure time, and darkness
//! between them. A DMD's mirrors are either on or off, so a DMD shows a grey pattern as a series of
//! bit planes: bit k for 2^k / (2^n - 1) of the time, least significant bit first. (The order
//! depends on the controller; DLP LightCrafter 4500 user's guide DLPU011, section 4.1, gives the
//! weights.) An exposure that covers the whole pattern cannot distinguish the bit planes from
//! constant light at the grey level. A pattern is therefore split into bit planes only if some
//! camera row is not exposed for the whole pattern.

use super::{PatternImage, Shot, Showing};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// A pattern and the interval in which it is shown, in nanoseconds of device time.
#[derive(Debug, Clone)]
pub(super) struct Lit {
    pub(super) pattern_image: Arc<PatternImage>,
    pub(super) from_ns: u64,
    pub(super) to_ns: u64,
}

/// Sets the patterns that a shot sees, in order of time, without overlap and with darkness between
/// them. If `planes` is given (with the projector's bit depth), patterns that some row does not see
/// completely are split into bit planes.
pub(super) fn show(
    shot: &mut Shot,
    patterns: impl IntoIterator<Item = Lit>,
    planes: Option<(&Planes, u32)>,
) {
    let mut shown: Vec<(u64, Option<Arc<PatternImage>>)> = vec![(0, None)];
    for lit in patterns {
        if lit.from_ns >= shot.end_ns() {
            break;
        }
        if lit.to_ns <= shot.start_ns {
            continue;
        }
        // Darkness of zero duration is dropped.
        if shown.last().is_some_and(|last| last.0 == lit.from_ns) {
            shown.pop();
        }
        match planes {
            Some((planes, bits)) if !covered(shot, &lit) && !binary(&lit.pattern_image, bits) => {
                let starts = (0..bits).map(|bit| plane_start_ns(&lit, bit, bits));
                let pattern_images = planes.of(&lit.pattern_image, bits);
                shown.extend(starts.zip(pattern_images.into_iter().map(Some)));
            }
            _ => shown.push((lit.from_ns, Some(lit.pattern_image))),
        }
        shown.push((lit.to_ns, None));
    }
    let first = shown.partition_point(|(from_ns, _)| *from_ns <= shot.start_ns);
    let later = shown.split_off(first);
    shot.pattern_image = shown.pop().and_then(|(_, pattern_image)| pattern_image);
    let mut now = shot.pattern_image.clone();
    let (end_ns, light) = (shot.end_ns(), shot.light);
    shot.then = later
        .into_iter()
        .take_while(|(from_ns, _)| *from_ns < end_ns)
        .filter(|(_, pattern_image)| {
            let same = match (pattern_image, &now) {
                (Some(a), Some(b)) => Arc::ptr_eq(a, b),
                (a, b) => a.is_none() && b.is_none(),
            };
            now = pattern_image.clone();
            !same
        })
        .map(|(from_ns, pattern_image)| Showing {
            from_ns,
            pattern_image,
            light,
        })
        .collect();
}

/// Returns whether every sensor row is exposed during the whole time that a pattern is shown.
fn covered(shot: &Shot, lit: &Lit) -> bool {
    let first_ends_ns = shot.start_ns.saturating_add(shot.exposure_ns);
    shot.row_start_ns(u32::MAX) <= lit.from_ns && lit.to_ns <= first_ends_ns
}

/// Returns the start of a bit plane in nanoseconds of device time, rounded down. The planes below it
/// take (2^bit - 1) / (2^bits - 1) of the pattern's time.
fn plane_start_ns(lit: &Lit, bit: u32, bits: u32) -> u64 {
    let part = |bits: u32| (1u128 << bits) - 1;
    let lasts_ns = u128::from(lit.to_ns.saturating_sub(lit.from_ns));
    let after_ns = lasts_ns * part(bit) / part(bits).max(1);
    lit.from_ns + after_ns as u64
}

/// Returns whether all bit planes of a pattern image are equal, so that it does not matter which
/// planes an exposure sees.
fn binary(pattern_image: &PatternImage, bits: u32) -> bool {
    let full = (1u16 << bits) - 1;
    pattern_image
        .levels()
        .iter()
        .all(|level| [0, full].contains(level))
}

/// Bit planes of the pattern images split most recently. They are kept so that the renderer gets the
/// same objects again.
#[derive(Debug, Default)]
pub(super) struct Planes {
    known: Mutex<VecDeque<Known>>,
}

#[derive(Debug)]
struct Known {
    pattern_image: Arc<PatternImage>,
    planes: Vec<Arc<PatternImage>>,
}

impl Known {
    fn bytes(&self) -> usize {
        self.planes.len() * self.pattern_image.levels().len() * size_of::<u16>()
    }
}

impl Planes {
    /// Maximum total size in bytes of the bit planes kept.
    const MAX_BYTES: usize = 64 << 20;

    /// Returns the bit planes of a pattern image, least significant first.
    fn of(&self, pattern_image: &Arc<PatternImage>, bits: u32) -> Vec<Arc<PatternImage>> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known
            .iter()
            .find(|k| Arc::ptr_eq(&k.pattern_image, pattern_image))
        {
            return found.planes.clone();
        }
        let planes: Vec<_> = (0..bits)
            .map(|bit| Arc::new(pattern_image.plane(bit, bits)))
            .collect();
        known.push_back(Known {
            pattern_image: pattern_image.clone(),
            planes: planes.clone(),
        });
        let mut bytes: usize = known.iter().map(Known::bytes).sum();
        while bytes > Self::MAX_BYTES {
            bytes -= known.pop_front().map_or(bytes, |oldest| oldest.bytes());
        }
        planes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Shutter;
    use phasmid_pattern::Axis;

    const BITS: u32 = 8;

    fn ramp() -> Arc<PatternImage> {
        Arc::new(PatternImage::Row(Axis::X, (0..256).collect()))
    }

    fn shot(start_ns: u64, exposure_ns: u64) -> Shot {
        Shot {
            start_ns,
            exposure_ns,
            light: 1.0,
            ..Shot::default()
        }
    }

    fn lit(pattern_image: &Arc<PatternImage>, from_ns: u64, to_ns: u64) -> Lit {
        let pattern_image = pattern_image.clone();
        Lit {
            pattern_image,
            from_ns,
            to_ns,
        }
    }

    /// Returns the mean level, 0 to 1, that the shot gives each column over an exposure that starts
    /// at `start_ns`.
    fn mean(shot: &Shot, start_ns: u64) -> Vec<f64> {
        let mut sum = vec![0.0; 256];
        for (place, time) in shot.seen(start_ns) {
            let lasts_ns = time.end - time.start;
            let pattern_image = match place {
                0 => &shot.pattern_image,
                _ => &shot.then[place - 1].pattern_image,
            };
            let Some(pattern_image) = pattern_image else {
                continue;
            };
            for (sum, level) in sum.iter_mut().zip(pattern_image.levels()) {
                *sum += f64::from(*level) / 255.0 * lasts_ns as f64 / shot.exposure_ns as f64;
            }
        }
        sum
    }

    /// Returns the time within an exposure `from..to` for which the mirror of a level is on,
    /// computed from the intervals of the bits, which last 1000 ns and doublings of that. The
    /// pattern lasts 255,000 ns.
    fn on_ns(level: u64, from: u64, to: u64) -> u64 {
        (0..8)
            .filter(|bit| level >> bit & 1 == 1)
            .map(|bit| {
                let (begin, end) = (((1 << bit) - 1) * 1000, ((2 << bit) - 1) * 1000);
                to.min(end).saturating_sub(from.max(begin))
            })
            .sum()
    }

    #[test]
    fn exposure_that_covers_the_pattern_sees_all_of_it() {
        let ramp = ramp();
        for (start, exposure, pattern_image, then) in [
            (5000, 255_000, true, 0),
            (5000, 300_000, true, 1),
            (4000, 256_000, false, 1),
            (0, 400_000, false, 2),
        ] {
            let mut shot = shot(start, exposure);
            let planes = Planes::default();
            show(
                &mut shot,
                [lit(&ramp, 5000, 260_000)],
                Some((&planes, BITS)),
            );
            assert_eq!(
                (shot.pattern_image.is_some(), shot.then.len()),
                (pattern_image, then)
            );
            for (level, mean) in mean(&shot, start).into_iter().enumerate() {
                let expected = level as f64 / 255.0 * 255e3 / exposure as f64;
                assert!((mean - expected).abs() < 1e-12, "{level}: {mean}");
            }
        }
    }

    #[test]
    fn partial_exposure_sees_only_the_bits_within_it() {
        let ramp = ramp();
        let planes = Planes::default();
        for (from, to) in [
            (0, 127_500),
            (127_500, 255_000),
            (0, 1),
            (1000, 3000),
            (254_999, 255_000),
            (3500, 254_000),
        ] {
            let mut shot = shot(10_000 + from, to - from);
            show(
                &mut shot,
                [lit(&ramp, 10_000, 265_000)],
                Some((&planes, BITS)),
            );
            for (level, mean) in mean(&shot, shot.start_ns).into_iter().enumerate() {
                let expected = on_ns(level as u64, from, to) as f64 / (to - from) as f64;
                assert!((mean - expected).abs() < 1e-12, "{from} {level}: {mean}");
            }
        }
        // All bits together give the level exactly.
        for level in 0..256 {
            assert_eq!(on_ns(level, 0, 255_000), level * 1000);
        }
    }

    /// A projector without bit planes shows a pattern's level all the time, and a one-bit pattern is
    /// not split.
    #[test]
    fn pattern_without_bit_planes_is_not_split() {
        let ramp = ramp();
        let mut half = shot(0, 500);
        show(&mut half, [lit(&ramp, 0, 1000)], None);
        assert!(
            half.pattern_image
                .as_ref()
                .is_some_and(|s| Arc::ptr_eq(s, &ramp))
        );
        assert_eq!(half.then, []);
        let stripes = Arc::new(PatternImage::Row(Axis::Y, vec![0, 255, 255, 0]));
        let planes = Planes::default();
        show(&mut half, [lit(&stripes, 0, 1000)], Some((&planes, BITS)));
        assert!(
            half.pattern_image
                .is_some_and(|s| Arc::ptr_eq(&s, &stripes))
        );
        assert_eq!(half.then, []);
    }

    /// Rows that start late see the darkness after a pattern and the first bits of the next one.
    #[test]
    fn a_rolling_shutter_sees_each_row_s_own_time() {
        let ramp = ramp();
        let white = Arc::new(PatternImage::Uniform(255));
        let mut shot = Shot {
            shutter: Shutter {
                line_time_ns: 1000,
                first_row: 0,
                rows: 300,
            },
            ..shot(0, 255_000)
        };
        let planes = Planes::default();
        let patterns = [
            lit(&white, 0, 255_000),
            lit(&ramp, 300_000, 555_000),
            lit(&white, 600_000, 700_000),
        ];
        show(&mut shot, patterns, Some((&planes, BITS)));
        for row in [0, 1, 45, 100, 299] {
            let start = shot.row_start_ns(row);
            for (level, mean) in mean(&shot, start).into_iter().enumerate() {
                let white_ns = 255_000u64.saturating_sub(start);
                let ramp_ns = on_ns(level as u64, 0, (start + 255_000).saturating_sub(300_000));
                let expected = match &*white {
                    // A uniform pattern image has a single level, which is the expected level of
                    // column 0.
                    PatternImage::Uniform(_) if level == 0 => (white_ns + ramp_ns) as f64 / 255e3,
                    _ => ramp_ns as f64 / 255e3,
                };
                assert!((mean - expected).abs() < 1e-12, "{row} {level}: {mean}");
            }
        }
        let known = planes.known.lock().unwrap();
        assert_eq!(known.len(), 1, "the third pattern comes too late");
    }

    #[test]
    fn the_bits_are_kept_within_bounds() {
        let planes = Planes::default();
        let image = |level| {
            Arc::new(PatternImage::Image {
                width: 1000,
                height: 1000,
                levels: vec![level; 1_000_000],
            })
        };
        let first = image(1);
        let bits = planes.of(&first, BITS);
        assert!(Arc::ptr_eq(&planes.of(&first, BITS)[7], &bits[7]));
        for level in 2..10 {
            planes.of(&image(level), BITS);
        }
        let known = planes.known.lock().unwrap();
        let bytes: usize = known.iter().map(Known::bytes).sum();
        assert!(bytes <= Planes::MAX_BYTES && known.len() == 4, "{bytes}");
    }
}
