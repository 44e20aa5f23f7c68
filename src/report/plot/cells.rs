//! Draws an area divided into cells, each with its count and shaded in proportion to it.

use super::{Anchor, Panel, Sheet};
use glam::DVec2;

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
        // Up to five layers of the translucent fill, more for larger counts.
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
