//! An area of a sheet with two axes.

use super::{Anchor, Axis, Sheet};
use glam::DVec2;

/// The area that two axes span. Values along y grow upwards unless the axis is reversed.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Upper left corner on the sheet.
    pub corner: DVec2,
    /// Width and height on the sheet.
    pub size: DVec2,
    /// Horizontal axis, left to right.
    pub x: Axis,
    /// Vertical axis, bottom to top.
    pub y: Axis,
}

/// Room left of a panel and below it, for the labels of ticks (up to seven letters) and of the axis.
pub const ROOM: DVec2 = DVec2::new(72.0, 42.0);

impl Panel {
    /// Returns the position of a pair of values on the sheet; `None` if an axis has no position for it.
    pub fn at(&self, value: DVec2) -> Option<DVec2> {
        let (tx, ty) = (self.x.at(value.x)?, self.y.at(value.y)?);
        Some(self.corner + self.size * DVec2::new(tx, 1.0 - ty))
    }

    /// Returns the position of a pair of values if it is in the panel.
    pub fn inside(&self, value: DVec2) -> Option<DVec2> {
        let at = self.at(value)?;
        let far = self.corner + self.size;
        // Includes the edges, despite rounding.
        let slack = DVec2::splat(1e-6);
        (at.cmpge(self.corner - slack).all() && at.cmple(far + slack).all()).then_some(at)
    }

    /// Draws the frame, the grid, the labels of the ticks, and the labels of the axes.
    pub fn draw(&self, sheet: &mut Sheet) {
        self.draw_rows(sheet);
        let far = self.corner + self.size;
        let ticks = self.x.ticks((self.size.x / 70.0).max(2.0) as usize);
        let places: Vec<(f64, String)> = ticks
            .into_iter()
            .filter_map(|(value, label)| {
                let t = self.x.at(value)?;
                Some((self.corner.x + t * self.size.x, label))
            })
            .collect();
        sheet.lines(
            "grid",
            places
                .iter()
                .map(|(x, _)| [DVec2::new(*x, self.corner.y), DVec2::new(*x, far.y)]),
        );
        for (x, label) in &places {
            sheet.text("", DVec2::new(*x, far.y + 16.0), Anchor::Middle, label);
        }
        let middle = DVec2::new(self.corner.x + 0.5 * self.size.x, far.y + 34.0);
        sheet.text("", middle, Anchor::Middle, self.x.label());
    }

    /// Draws the frame, and grid and labels of the y axis only: for bars, which have names along x.
    pub fn draw_rows(&self, sheet: &mut Sheet) {
        let far = self.corner + self.size;
        let ticks = self.y.ticks((self.size.y / 34.0).max(2.0) as usize);
        let places: Vec<(f64, String)> = ticks
            .into_iter()
            .filter_map(|(value, label)| {
                let t = self.y.at(value)?;
                Some((self.corner.y + (1.0 - t) * self.size.y, label))
            })
            .collect();
        sheet.lines(
            "grid",
            places
                .iter()
                .map(|(y, _)| [DVec2::new(self.corner.x, *y), DVec2::new(far.x, *y)]),
        );
        for (y, label) in &places {
            let at = DVec2::new(self.corner.x - 6.0, y + 4.0);
            sheet.text("", at, Anchor::End, label);
        }
        let middle = DVec2::new(self.corner.x - 59.0, self.corner.y + 0.5 * self.size.y);
        sheet.text_upwards("", middle, Anchor::Middle, self.y.label());
        sheet.rect("frame", self.corner, self.size, None);
    }

    /// Draws a heading above the panel.
    pub fn head(&self, sheet: &mut Sheet, words: &str) {
        let at = self.corner - DVec2::new(0.0, 8.0);
        sheet.text("name", at, Anchor::Start, words);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_go_up_and_rows_of_an_image_down() {
        let mut panel = Panel {
            corner: DVec2::new(100.0, 10.0),
            size: DVec2::new(200.0, 50.0),
            x: Axis::between("x", 0.0, 10.0),
            y: Axis::between("y", 0.0, 10.0),
        };
        assert_eq!(panel.at(DVec2::ZERO), Some(DVec2::new(100.0, 60.0)));
        assert_eq!(panel.at(DVec2::splat(10.0)), Some(DVec2::new(300.0, 10.0)));
        assert!(panel.inside(DVec2::splat(10.0)).is_some());
        assert_eq!(panel.inside(DVec2::new(11.0, 5.0)), None);
        assert_eq!(panel.at(DVec2::new(f64::NAN, 0.0)), None);
        panel.y = panel.y.reversed();
        assert_eq!(panel.at(DVec2::ZERO), Some(DVec2::new(100.0, 10.0)));
    }
}
