//! Draws lines, crosses, arrows and text at positions of an image that may be enlarged.

use glam::DVec2;
use image::{Rgb, RgbImage};
use phasmid_report::font::Font;

/// Background of text.
pub(super) const PAPER: [u8; 3] = [22, 22, 24];

pub(super) struct Pen<'a> {
    image: &'a mut RgbImage,
    zoom: f64,
}

impl<'a> Pen<'a> {
    pub(super) fn new(image: &'a mut RgbImage, zoom: f64) -> Self {
        Self { image, zoom }
    }

    /// Converts to coordinates of the enlarged image; integers are pixel centres in both.
    fn place(&self, px: DVec2) -> DVec2 {
        (px + 0.5) * self.zoom - 0.5
    }

    fn dot(&mut self, at: DVec2, colour: [u8; 3]) {
        let at = at.round();
        let size = DVec2::new(self.image.width().into(), self.image.height().into());
        if at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all() {
            self.image.put_pixel(at.x as u32, at.y as u32, Rgb(colour));
        }
    }

    /// Draws a line between two positions; draws nothing if an end is far outside the image.
    pub(super) fn line(&mut self, from: DVec2, to: DVec2, colour: [u8; 3]) {
        let (from, to) = (self.place(from), self.place(to));
        let far = 3.0 * f64::from(self.image.width().max(self.image.height()));
        if !(from.abs().max_element() <= far && to.abs().max_element() <= far) {
            return;
        }
        let steps = (to - from).abs().max_element().ceil().max(1.0);
        for i in 0..=steps as u32 {
            self.dot(from.lerp(to, f64::from(i) / steps), colour);
        }
    }

    pub(super) fn cross(&mut self, at: DVec2, reach: f64, colour: [u8; 3]) {
        for arm in [DVec2::X, DVec2::Y] {
            self.line(at - arm * reach, at + arm * reach, colour);
        }
    }

    /// Draws a line three pixels wide with an arrowhead.
    pub(super) fn arrow(&mut self, from: DVec2, to: DVec2, colour: [u8; 3]) {
        let along = (to - from).normalize_or_zero();
        let aside = along.perp() / self.zoom;
        for k in [-1.0, 0.0, 1.0] {
            self.line(from + aside * k, to + aside * k, colour);
        }
        let head = (0.25 * from.distance(to)).clamp(3.0, 12.0);
        for side in [-0.6, 0.6] {
            self.line(to, to - (along + along.perp() * side) * head, colour);
        }
    }

    /// Draws text whose near edge touches `at` and which extends from there in the direction
    /// `away`.
    pub(super) fn text(&mut self, at: DVec2, away: DVec2, text: &str, colour: [u8; 3]) {
        let font = Font::for_image(self.image.height());
        let half = DVec2::new(font.width(text).into(), font.line().into()) / 2.0;
        let away = away.normalize_or_zero();
        let corner = self.place(at) + away * half.dot(away.abs()) - half;
        let size = DVec2::new(self.image.width().into(), self.image.height().into());
        // The font takes unsigned pixel positions: text that would start outside moves to the
        // border.
        let corner = corner.max(DVec2::ZERO).round();
        if corner.cmplt(size).all() {
            label(self.image, text, (corner.x as u32, corner.y as u32), colour);
        }
    }
}

/// Draws text with its upper left corner at (x, y), on a dark plate.
pub(super) fn label(image: &mut RgbImage, text: &str, (x, y): (u32, u32), colour: [u8; 3]) {
    let font = Font::for_image(image.height());
    let right = x.saturating_add(font.width(text)).min(image.width());
    for row in y..y.saturating_add(font.line()).min(image.height()) {
        for column in x..right {
            image.put_pixel(column, row, Rgb(PAPER));
        }
    }
    font.draw(image, text, (x, y), colour);
}
