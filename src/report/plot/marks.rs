//! Draws curves, dots, spans (error bars), and cells: an area divided into cells, each with its count
//! and shaded in proportion to it.

use super::{Anchor, Panel, Sheet};
use glam::DVec2;

/// Draws a line through points, with gaps at points that are undefined or outside the panel.
pub fn curve(sheet: &mut Sheet, panel: &Panel, class: &str, points: &[DVec2]) {
    let places: Vec<Option<DVec2>> = points.iter().map(|p| panel.inside(*p)).collect();
    for run in places.split(Option::is_none) {
        let run: Vec<DVec2> = run.iter().flatten().copied().collect();
        if run.len() > 1 {
            sheet.polyline(&format!("line {class}"), &run, false, None);
        }
    }
}

/// Draws a disc at every point in the panel, of class `fill` or `ring`, with the tooltip that `tips` has
/// for it, if any.
pub fn dots(
    sheet: &mut Sheet,
    panel: &Panel,
    class: &str,
    radius: f64,
    points: &[DVec2],
    tips: &[String],
) {
    for (i, point) in points.iter().enumerate() {
        if let Some(at) = panel.inside(*point) {
            let tip = tips.get(i).map(String::as_str);
            sheet.disc(class, at, radius, tip);
        }
    }
}

/// Draws error bars `[x, low, high]`: vertical lines from `low` to `high` at each x, clipped to the
/// panel.
pub fn spans(sheet: &mut Sheet, panel: &Panel, class: &str, spans: &[[f64; 3]]) {
    let (floor, ceiling) = panel.y.range();
    let lines = spans.iter().filter_map(|[x, low, high]| {
        let from = panel.inside(DVec2::new(*x, low.max(floor)))?;
        let to = panel.inside(DVec2::new(*x, high.min(ceiling)))?;
        Some([from, to])
    });
    sheet.lines(&format!("line {class}"), lines);
}

/// Draws `counts` over a whole panel, `columns` per row, row by row from the start of the y axis.
pub fn cells(sheet: &mut Sheet, panel: &Panel, class: &str, counts: &[usize], columns: usize) {
    let columns = columns.max(1);
    let rows = counts.len().div_ceil(columns);
    let size = panel.size / DVec2::new(columns as f64, rows.max(1) as f64);
    let most = counts.iter().max().copied().unwrap_or(0).max(1);
    let (y0, y1) = panel.y.range();
    // A reversed axis starts at the top.
    let down = panel
        .y
        .at(y0)
        .zip(panel.y.at(y1))
        .is_some_and(|(a, b)| a > b);
    for (i, count) in counts.iter().enumerate() {
        let row = if down {
            i / columns
        } else {
            rows - 1 - i / columns
        };
        let place = DVec2::new((i % columns) as f64, row as f64);
        let corner = panel.corner + place * size;
        // One to five layers of the translucent fill, in proportion to the count.
        let layers = (*count * 5).div_ceil(most);
        for _ in 0..layers {
            sheet.rect(&format!("area {class}"), corner, size, None);
        }
        let middle = corner + 0.5 * size + DVec2::new(0.0, 4.0);
        sheet.text("", middle, Anchor::Middle, &count.to_string());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Axis;

    fn panel() -> Panel {
        Panel {
            corner: DVec2::ZERO,
            size: DVec2::splat(100.0),
            x: Axis::between("", 0.0, 10.0),
            y: Axis::between("", 0.0, 10.0),
        }
    }

    #[test]
    fn curve_is_broken_outside_the_panel() {
        let mut sheet = Sheet::new(100.0, 100.0);
        let points: Vec<DVec2> = [1.0, 2.0, f64::NAN, 4.0, 99.0, 6.0, 7.0, 8.0]
            .iter()
            .enumerate()
            .map(|(i, y)| DVec2::new(i as f64, *y))
            .collect();
        curve(&mut sheet, &panel(), "c0", &points);
        let text = sheet.into_element("");
        assert_eq!(text.matches("<polyline").count(), 2, "{text}");
        assert!(text.contains("points=\"50,40 60,30 70,20\""), "{text}");
    }

    #[test]
    fn dots_and_spans_stay_inside() {
        let mut sheet = Sheet::new(100.0, 100.0);
        let points = [DVec2::splat(5.0), DVec2::splat(50.0)];
        dots(
            &mut sheet,
            &panel(),
            "fill c1",
            2.0,
            &points,
            &["mid".into()],
        );
        spans(
            &mut sheet,
            &panel(),
            "c1",
            &[[5.0, -3.0, 2.0], [5.0, f64::NAN, f64::NAN]],
        );
        let text = sheet.into_element("");
        assert_eq!(text.matches("<circle").count(), 1);
        assert!(text.contains("<title>mid</title>"));
        assert!(text.contains("M50 100L50 80"), "{text}");
    }

    #[test]
    fn counts_stand_in_their_cells() {
        let panel = Panel {
            corner: DVec2::ZERO,
            size: DVec2::new(300.0, 100.0),
            x: Axis::between("", 0.0, 3.0),
            y: Axis::between("", 0.0, 2.0).reversed(),
        };
        let mut sheet = Sheet::new(300.0, 100.0);
        cells(&mut sheet, &panel, "c0", &[0, 1, 2, 3, 4, 500], 3);
        let text = sheet.into_element("");
        assert!(text.contains("x=\"50\" y=\"29\" text-anchor=\"middle\">0<"));
        assert!(text.contains("x=\"250\" y=\"79\" text-anchor=\"middle\">500<"));
        assert_eq!(text.matches("<rect").count(), 4 + 5);
        cells(&mut Sheet::new(1.0, 1.0), &panel, "c0", &[], 0);
    }
}
