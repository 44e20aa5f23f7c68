//! Whitened residuals compared with the standard normal distribution: a histogram, and a
//! quantile-quantile plot, which shows the tails.

use super::html::note;
use super::spots::Spot;
use glam::DVec2;
use phasmid_report::plot::{Axis, Histogram, Panel, ROOM, Sheet, curve, dots, figures};
use std::f64::consts::TAU;

const SIDE: f64 = 400.0;
const HEIGHT: f64 = 230.0;
const HEADING: f64 = 30.0;
/// Half width of the histogram's range, in standard deviations.
const ENDS: f64 = 5.0;
/// Number of bins.
const BINS: usize = 50;

pub(super) fn whitened(camera: &[Spot], projector: &[Spot]) -> String {
    let mut sheet = Sheet::new(
        2.0 * (ROOM.x + SIDE + 8.0),
        2.0 * (HEADING + HEIGHT + ROOM.y + 6.0),
    );
    let mut moments = Vec::new();
    for (column, (name, class, spots)) in [("Camera", "c0", camera), ("Projector", "c1", projector)]
        .into_iter()
        .enumerate()
    {
        let mut values: Vec<f64> = spots
            .iter()
            .filter(|s| s.counts)
            .flat_map(|s| s.whitened.to_array())
            .filter(|v| v.is_finite())
            .collect();
        values.sort_unstable_by(f64::total_cmp);
        let left = ROOM.x + column as f64 * (ROOM.x + SIDE + 8.0);
        histogram(&mut sheet, left, name, class, &values);
        quantiles(&mut sheet, left, class, &values);
        let (mean, deviation) = mean_and_deviation(&values);
        moments.push(format!(
            "{name}: {} components, mean {}, standard deviation {}.",
            values.len(),
            figures(mean, 2),
            figures(deviation, 4)
        ));
    }
    let label = "Whitened residuals against the unit normal distribution";
    let words = "Both components of every point that counts, divided by their standard deviation. \
                 Grey: the unit normal distribution.";
    sheet.into_element(label) + &note(&format!("{} {words}", moments.join(" ")))
}

fn histogram(sheet: &mut Sheet, left: f64, name: &str, class: &str, values: &[f64]) {
    let found = Histogram::new(values.iter().copied(), -ENDS, ENDS, BINS);
    let peak = [density(0.0)].into_iter().chain(found.densities());
    let panel = Panel {
        corner: DVec2::new(left, HEADING),
        size: DVec2::new(SIDE, HEIGHT),
        x: Axis::between("whitened residual", -ENDS, ENDS),
        y: Axis::from_zero("density", peak),
    };
    panel.draw(sheet);
    let [below, above] = found.outside;
    let head = format!("{name}; {below} below and {above} above the ends");
    panel.head(sheet, &head);
    found.draw(sheet, &panel, class);
    let normal: Vec<DVec2> = (0..=200)
        .map(|i| ENDS * (f64::from(i) / 100.0 - 1.0))
        .map(|z| DVec2::new(z, density(z)))
        .collect();
    curve(sheet, &panel, "c2", &normal);
}

/// Draws quantiles of sorted values against quantiles of the standard normal distribution.
fn quantiles(sheet: &mut Sheet, left: f64, class: &str, values: &[f64]) {
    let points = against_normal(values);
    let reach = points
        .iter()
        .map(|p| p.abs().max_element())
        .fold(2.0, f64::max);
    let ends = (1.1 * reach).min(20.0);
    let panel = Panel {
        corner: DVec2::new(left, 2.0 * HEADING + HEIGHT + ROOM.y),
        size: DVec2::new(SIDE, HEIGHT),
        x: Axis::between("quantile of the unit normal", -ends, ends),
        y: Axis::between("quantile of residuals", -ends, ends),
    };
    panel.draw(sheet);
    curve(
        sheet,
        &panel,
        "c2",
        &[DVec2::splat(-ends), DVec2::splat(ends)],
    );
    dots(sheet, &panel, &format!("fill {class}"), 3.0, &points, &[]);
}

/// Pairs of quantiles (normal, data) at every quarter of a standard deviation, as far out as at
/// least three values lie beyond.
fn against_normal(values: &[f64]) -> Vec<DVec2> {
    let count = values.len() as f64;
    (-20..=20)
        .map(|i| 0.25 * f64::from(i))
        .filter_map(|z| {
            let below = share_below(z) * count;
            let inside = below >= 3.0 && count - below >= 3.0;
            // The quantile at probability p is the value at index p n - 1/2, counted from 0.
            let place = below - 0.5;
            let (low, part) = (place.floor(), place - place.floor());
            let at = |i: f64| values.get(i as usize).copied();
            let value = at(low)? * (1.0 - part) + at(low + 1.0)? * part;
            inside.then_some(DVec2::new(z, value))
        })
        .collect()
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, square.sqrt())
}

/// Probability density at `z`.
fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / TAU.sqrt()
}

/// Probability of a value below `z`, by the series of Abramowitz and Stegun, "Handbook of
/// Mathematical Functions", equation 26.2.11. It is accurate to 1e-14 for |z| up to 6; larger
/// values are clamped to 6.
fn share_below(z: f64) -> f64 {
    let z = z.clamp(-6.0, 6.0);
    let (mut term, mut sum) = (z, z);
    let mut odd = 1.0;
    // Terms decrease once `odd` exceeds the square of z.
    while term.abs() > 1e-17 * sum.abs() {
        odd += 2.0;
        term *= z * z / odd;
        sum += term;
    }
    0.5 + density(z) * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_sample_lies_on_the_diagonal() {
        // Exact quantiles, by bisection.
        let quantile = |p: f64| {
            let (mut low, mut high) = (-6.0, 6.0);
            for _ in 0..60 {
                let z = 0.5 * (low + high);
                if share_below(z) < p {
                    low = z
                } else {
                    high = z
                }
            }
            0.5 * (low + high)
        };
        let values: Vec<f64> = (0..2000)
            .map(|i| 2.0 * quantile((f64::from(i) + 0.5) / 2000.0))
            .collect();
        let points = against_normal(&values);
        assert_eq!(points.len(), 23);
        for p in points {
            assert!((p.y - 2.0 * p.x).abs() < 0.01, "{p}");
        }
    }

    #[test]
    fn few_values_have_few_quantiles() {
        for values in [&[][..], &[1.0], &[1.0, 2.0]] {
            assert!(against_normal(values).is_empty());
        }
    }

    #[test]
    fn shares_match_published_tables() {
        for (z, share) in [
            (0.0, 0.5),
            (1.0, 0.841_344_746_068_542_9),
            (-1.959_963_984_540_054, 0.025),
            (3.090_232_306_167_813, 0.999),
            (-4.753_424_308_822_899, 1e-6),
        ] {
            assert!((share_below(z) - share).abs() < 1e-14, "{z}");
        }
        assert!(share_below(f64::INFINITY) > 1.0 - 1e-8);
        assert!(share_below(f64::NAN).is_nan());
    }
}
