//! Round numbers along an axis: steps of 1, 2 or 5 times a power of ten.

/// Returns the smallest of 1, 2, 5 or 10 times a power of ten that is at least `least`; 1 if `least` is
/// not a positive number.
pub(super) fn round_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let power = least.log10().floor() as i32;
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| scaled(m, power))
        // The tolerance accepts a step of 0.1 for a request of 0.1 + 1e-17.
        .find(|step| *step >= least * (1.0 - 1e-9))
        .unwrap_or_else(|| scaled(10.0, power))
}

/// Returns `m` times ten to the power `exponent`, rounded like the decimal literal.
fn scaled(m: f64, exponent: i32) -> f64 {
    if (-300..0).contains(&exponent) {
        m / 10f64.powi(-exponent)
    } else {
        m * 10f64.powi(exponent)
    }
}

/// Returns ticks at multiples of a round step within [low, high], at most about `most` of them, each
/// with its label.
pub(crate) fn linear(low: f64, high: f64, most: usize) -> Vec<(f64, String)> {
    let step = round_step((high - low) / most.max(1) as f64);
    let slack = 1e-6 * step;
    let first = ((low - slack) / step).ceil();
    let last = ((high + slack) / step).floor();
    // If the ends are this far from zero, rounding hides the steps.
    if !(first.is_finite() && last.is_finite()) || first.abs().max(last.abs()) > 1e9 {
        return Vec::new();
    }
    let decimals = decimals(step);
    let count = (last - first).clamp(-1.0, 2.0 * most as f64 + 2.0) as i64;
    (0..=count)
        .map(|i| {
            let value = (first + i as f64) * step;
            (value, label(value, step, decimals))
        })
        .collect()
}

/// Returns ticks at powers of ten within [low, high]. Over few decades they are also at 2 and 5 times
/// these powers; if there are fewer than three, they are at multiples of a round step instead.
pub(super) fn logarithmic(low: f64, high: f64) -> Vec<(f64, String)> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let span = last - first;
    let multiples: &[f64] = if span <= 3 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let stride = (span / 10 + 1) as usize;
    let ticks: Vec<(f64, String)> = (first..=last)
        .step_by(stride)
        .flat_map(|e| multiples.iter().map(move |m| (scaled(*m, e), e)))
        .filter(|(value, _)| *value >= low * (1.0 - 1e-9) && *value <= high * (1.0 + 1e-9))
        .map(|(value, e)| {
            // Longer labels would reach into the label of the axis.
            let text = if (-3..=4).contains(&e) {
                format!("{value:.*}", (-e).max(0) as usize)
            } else {
                format!("{value:e}")
            };
            (value, text)
        })
        .collect();
    if ticks.len() >= FEWEST {
        return ticks;
    }
    // Half the step gives at least twice as many ticks, minus one.
    let coarse = linear(low, high, 2 * FEWEST);
    match coarse.len() < FEWEST {
        true => linear(low, high, 4 * FEWEST),
        false => coarse,
    }
}

/// Minimum number of ticks that makes a logarithmic axis readable.
const FEWEST: usize = 3;

fn decimals(step: f64) -> usize {
    (0..12)
        .find(|d| {
            let shifted = step * 10f64.powi(*d);
            shifted >= 0.5 && (shifted - shifted.round()).abs() < 1e-6 * shifted
        })
        .unwrap_or(12) as usize
}

fn label(value: f64, step: f64, decimals: usize) -> String {
    let size = value.abs();
    if size < step * 1e-6 {
        return "0".to_owned();
    }
    if size >= 1e7 || decimals > 6 {
        // As many digits as distinguish neighbours.
        let place = |v: f64| (v.log10() + 1e-9).floor() as i32;
        let digits = (place(size) - place(step)).clamp(0, 12) as usize;
        return format!("{value:.digits$e}");
    }
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, most: usize) -> Vec<String> {
        linear(low, high, most).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_have_round_steps() {
        assert_eq!(
            labels(0.0, 1.0, 5),
            ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(labels(-0.012, 0.013, 3), ["-0.01", "0", "0.01"]);
        assert_eq!(labels(3.0, 1140.0, 6), ["200", "400", "600", "800", "1000"]);
        assert_eq!(labels(0.0, 3e-9, 3), ["0", "1e-9", "2e-9", "3e-9"]);
        assert_eq!(labels(0.0, 4e8, 2), ["0", "2e8", "4e8"]);
    }

    #[test]
    fn labels_are_the_values_they_stand_at() {
        for scale in [1e-12, 3.7e-4, 1.0, 42.0, 1e9] {
            let ticks = linear(-1.3 * scale, 2.9 * scale, 7);
            assert!((3..=9).contains(&ticks.len()), "{ticks:?}");
            for (value, text) in ticks {
                let read: f64 = text.parse().unwrap();
                assert!((read - value).abs() <= 1e-9 * scale, "{text} at {value}");
            }
        }
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        let ticks: Vec<String> = logarithmic(0.05, 20.0).into_iter().map(|t| t.1).collect();
        assert_eq!(ticks, ["0.1", "1", "10"]);
        let ticks: Vec<String> = logarithmic(1.0, 10.0).into_iter().map(|t| t.1).collect();
        assert_eq!(ticks, ["1", "2", "5", "10"]);
        assert!(logarithmic(1e-300, 1e300).len() < 20);
    }

    #[test]
    fn a_part_of_a_decade_has_ticks_enough_to_be_read() {
        for (low, high) in [(60.0, 140.0), (0.021, 0.034), (7e-15, 1.4e-14), (0.9, 1.1)] {
            let ticks = logarithmic(low, high);
            assert!((3..12).contains(&ticks.len()), "{low} {high}: {ticks:?}");
            for (value, text) in ticks {
                let read: f64 = text.parse().unwrap();
                // Rounding may move a tick past an end.
                let range = low * (1.0 - 1e-9)..=high * (1.0 + 1e-9);
                assert!(range.contains(&value) && (read / value - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn invalid_ranges_give_few_ticks() {
        for (low, high) in [
            (f64::NAN, 1.0),
            (0.0, f64::INFINITY),
            (1.0, 1.0),
            (2.0, 1.0),
            (1e15, 1e15 + 1.0),
            (-1e308, 1e308),
        ] {
            assert!(linear(low, high, 5).len() < 14, "{low} {high}");
        }
    }
}
