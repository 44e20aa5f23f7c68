//! Draws enlarged arrows over an area, with a reference arrow.

use super::ticks::round_step;
use super::{Anchor, Panel, Sheet, figures};
use glam::DVec2;

/// An arrow, in the units of the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrow {
    /// Start of the arrow.
    pub at: DVec2,
    /// Vector from start to head, before enlargement.
    pub by: DVec2,
}

/// Maximum number of arrows that are drawn.
const MOST: usize = 12_000;
/// Minimum and maximum length on the sheet of an arrow at the 95th percentile of the lengths.
const LENGTHS: [f64; 2] = [9.0, 30.0];
/// Minimum length of the reference arrow on the sheet.
const SAMPLE: f64 = 25.0;

/// Draws arrows in a panel whose axes have equal scales. All are enlarged by one factor, chosen so that
/// they are visible; a reference arrow of round length above the panel's right end shows this factor.
/// If there are more than 12,000 arrows, only every n-th is drawn. Returns the factor, in units of the
/// sheet per unit of `by`; `None` if no arrow lies in the panel and has a length.
pub fn quiver(
    sheet: &mut Sheet,
    panel: &Panel,
    class: &str,
    arrows: &[Arrow],
    unit: &str,
) -> Option<f64> {
    let placed: Vec<(DVec2, DVec2)> = arrows
        .iter()
        .filter(|a| a.by.is_finite())
        .filter_map(|a| Some((panel.inside(a.at)?, a.by)))
        .collect();
    let mut sizes: Vec<f64> = placed.iter().map(|(_, by)| by.length()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let large = *sizes.get(sizes.len() * 19 / 20)?;
    // Many arrows are drawn shorter, so that they do not cover one another.
    let apart = (panel.size.x * panel.size.y / placed.len() as f64).sqrt();
    let length = (2.0 * apart).clamp(LENGTHS[0], LENGTHS[1]);
    let scale = length / large;
    if !(scale.is_finite() && scale > 0.0) {
        return None;
    }
    // Directions of the axes on the sheet.
    let towards = |x: f64, y: f64| panel.at(DVec2::new(x, y));
    let ((x0, x1), (y0, y1)) = (panel.x.range(), panel.y.range());
    let sense = (towards(x1, y1)? - towards(x0, y0)?).signum();
    let step = placed.len().div_ceil(MOST).max(1);
    let shown = placed.iter().step_by(step);
    sheet.lines(
        &format!("thin {class}"),
        shown.flat_map(|(at, by)| arrow(*at, *by * sense * scale)),
    );
    let sample = round_step(SAMPLE / scale);
    let end = panel.corner + DVec2::new(panel.size.x, -12.0);
    let start = end - DVec2::new(sample * scale, 0.0);
    sheet.lines(&format!("line {class}"), arrow(start, end - start));
    let words = format!("{} {unit}", figures(sample, 1));
    let at = start + DVec2::new(-6.0, 4.0);
    sheet.text("", at, Anchor::End, &words);
    Some(scale)
}

/// Returns the lines of an arrow: the shaft and both sides of the head.
fn arrow(from: DVec2, by: DVec2) -> [[DVec2; 2]; 3] {
    let to = from + by;
    let back = -by.normalize_or_zero() * (0.35 * by.length()).min(4.0);
    let wing = |side: f64| to + back + 0.5 * side * back.perp();
    [[from, to], [to, wing(1.0)], [to, wing(-1.0)]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Axis;

    fn panel() -> Panel {
        Panel {
            corner: DVec2::new(10.0, 20.0),
            size: DVec2::splat(100.0),
            x: Axis::between("", 0.0, 1000.0),
            y: Axis::between("", 0.0, 1000.0).reversed(),
        }
    }

    /// Returns the drawn shafts: start and head.
    fn shafts(text: &str) -> Vec<[DVec2; 2]> {
        let path = text.split("class=\"thin c0\" d=\"").nth(1).unwrap();
        let path = path.split('"').next().unwrap();
        let point = |s: &str| {
            let (x, y) = s.split_once(' ').unwrap();
            DVec2::new(x.parse().unwrap(), y.parse().unwrap())
        };
        let lines: Vec<[DVec2; 2]> = path[1..]
            .split('M')
            .map(|line| {
                let (a, b) = line.split_once('L').unwrap();
                [point(a), point(b)]
            })
            .collect();
        lines.chunks(3).map(|arrow| arrow[0]).collect()
    }

    #[test]
    fn arrows_are_those_of_the_data() {
        let arrows: Vec<Arrow> = (0..40)
            .map(|i| Arrow {
                at: DVec2::new(20.0 * f64::from(i), 500.0),
                by: DVec2::new(0.003 * f64::from(i % 7), -0.01 + 0.002 * f64::from(i % 5)),
            })
            .collect();
        let mut sheet = Sheet::new(120.0, 130.0);
        let scale = quiver(&mut sheet, &panel(), "c0", &arrows, "px").unwrap();
        let text = sheet.into_element("");
        let drawn = shafts(&text);
        assert_eq!(drawn.len(), 40);
        for (line, arrow) in drawn.iter().zip(&arrows) {
            let foot = DVec2::new(10.0, 20.0) + arrow.at * 0.1;
            assert!((line[0] - foot).length() < 0.02);
            // A larger row is further down on the sheet.
            let by = (line[1] - line[0]) / scale;
            assert!((by - arrow.by).length() < 0.02 / scale, "{by} {}", arrow.by);
        }
        // The reference arrow ends above the panel's right end and has the length in its label.
        let sample = text.split("class=\"line c0\" d=\"M").nth(1).unwrap();
        let from: f64 = sample.split(' ').next().unwrap().parse().unwrap();
        let said = text.split(" px</text>").next().unwrap();
        let said: f64 = said.rsplit('>').next().unwrap().parse().unwrap();
        assert!(((110.0 - from) - said * scale).abs() < 0.02, "{text}");
    }

    #[test]
    fn invalid_arrows_are_left_out_and_output_is_bounded() {
        let mut sheet = Sheet::new(120.0, 130.0);
        let odd = [
            Arrow {
                at: DVec2::NAN,
                by: DVec2::ONE,
            },
            Arrow {
                at: DVec2::ONE,
                by: DVec2::INFINITY,
            },
            Arrow {
                at: DVec2::splat(-50.0),
                by: DVec2::ONE,
            },
        ];
        assert_eq!(quiver(&mut sheet, &panel(), "c0", &odd, "px"), None);
        assert_eq!(quiver(&mut sheet, &panel(), "c0", &[], "px"), None);
        let still = [Arrow {
            at: DVec2::ONE,
            by: DVec2::ZERO,
        }];
        assert_eq!(quiver(&mut sheet, &panel(), "c0", &still, "px"), None);
        let many = vec![
            Arrow {
                at: DVec2::ONE,
                by: DVec2::ONE
            };
            100_000
        ];
        assert!(quiver(&mut sheet, &panel(), "c0", &many, "px").is_some());
        assert!(sheet.into_element("").len() < 1_500_000);
    }
}
