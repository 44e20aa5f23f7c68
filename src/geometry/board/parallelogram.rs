//! The fraction of a parallelogram covered by a disc or a rectangle.

use glam::DVec2;
use std::f64::consts::PI;

/// Angle in radians below which the area of a circular segment is computed from its series.
const SMALL: f64 = 0.5;

/// A parallelogram of non-zero area.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parallelogram {
    /// Centre.
    at: DVec2,
    /// Corners relative to the centre, counter-clockwise if y points up.
    corners: [DVec2; 4],
    area: f64,
    /// Half sides of the parallelogram's axis-aligned bounding box.
    pub(super) half: DVec2,
}

impl Parallelogram {
    /// Creates a parallelogram from its centre and two sides; `None` if it degenerates to a line or
    /// point.
    pub(super) fn new(at: DVec2, across: DVec2, down: DVec2) -> Option<Self> {
        let area = across.perp_dot(down);
        let size = across.length_squared() + down.length_squared();
        // Rounding can give collinear sides a small area.
        if !(area.abs() > 1e-9 * size) {
            return None;
        }
        let down = down * area.signum();
        let (sum, difference) = ((across + down) / 2.0, (across - down) / 2.0);
        Some(Self {
            at,
            corners: [-sum, difference, sum, -difference],
            area: area.abs(),
            half: (across.abs() + down.abs()) / 2.0,
        })
    }

    /// Returns the fraction of the parallelogram that lies in a disc, 0 to 1.
    ///
    /// The intersection consists of a polygon, formed by the parts of the sides inside the circle,
    /// and the circular segments from each point where the outline leaves the circle to the point
    /// where it re-enters. Segment angles are summed from corner to corner, so that a small angle is
    /// never taken for a full turn.
    pub(super) fn in_disc(&self, center: DVec2, radius: f64) -> f64 {
        let middle = (self.at - center) / radius;
        let corners = self.corners.map(|corner| corner / radius);
        let is_inside = corners.map(|corner| (middle + corner).length_squared() <= 1.0);
        if is_inside == [true; 4] {
            return 1.0;
        }
        let half = self.half / radius;
        if (middle.abs() - half).max(DVec2::ZERO).length_squared() >= 1.0 {
            return 0.0;
        }
        let mut outline = Outline::default();
        for i in 0..4 {
            let (p, step) = (corners[i], corners[(i + 1) % 4] - corners[i]);
            let ends = [is_inside[i], is_inside[(i + 1) % 4]];
            outline.side(middle, p, step, ends);
        }
        let area = self.area / (radius * radius);
        (outline.area() / area).clamp(0.0, 1.0)
    }

    /// Returns the fraction of the parallelogram that lies in an axis-aligned rectangle, 0 to 1.
    pub(super) fn in_rectangle(&self, low: DVec2, high: DVec2) -> f64 {
        let (low, high) = (low - self.at, high - self.at);
        if low.cmple(-self.half).all() && high.cmpge(self.half).all() {
            return 1.0;
        }
        if low.cmpge(self.half).any() || high.cmple(-self.half).any() {
            return 0.0;
        }
        let mut polygon = Polygon::new(self.corners);
        polygon.cut(DVec2::X, high.x);
        polygon.cut(DVec2::NEG_X, -low.x);
        polygon.cut(DVec2::Y, high.y);
        polygon.cut(DVec2::NEG_Y, -low.y);
        (polygon.area() / self.area).clamp(0.0, 1.0)
    }
}

/// Outline of the intersection with the unit circle, accumulated side by side.
#[derive(Default)]
struct Outline {
    /// Twice the area of the polygon.
    polygon: f64,
    /// Area of the circular segments.
    segments: f64,
    /// Angle since the outline last left the circle, or since the start.
    angle: f64,
    /// Angle before the first entry into the circle, and the point of entry.
    first: Option<(f64, DVec2)>,
    /// Point of the last exit, relative to the parallelogram's centre.
    left: Option<DVec2>,
}

impl Outline {
    /// Adds the side from `p` to `p + step`, relative to `middle`; the flags say whether its ends
    /// are inside the circle.
    fn side(&mut self, middle: DVec2, p: DVec2, step: DVec2, [starts_in, ends_in]: [bool; 2]) {
        let q = p + step;
        if starts_in && ends_in {
            self.polygon += p.perp_dot(q);
            return;
        }
        // Solve from the point of the line nearest the circle's centre, in both directions.
        let length2 = step.length_squared();
        let start = middle + p;
        let nearest = -start.dot(step) / length2;
        let half2 = (1.0 - (start + step * nearest).length_squared()) / length2;
        if !(starts_in || ends_in || half2 > 0.0 && nearest > 0.0 && nearest < 1.0) {
            self.angle += angle(start, middle + q);
            return;
        }
        let half = half2.max(0.0).sqrt();
        let enter = match starts_in {
            true => p,
            false => p + step * (nearest - half).clamp(0.0, 1.0),
        };
        let leave = match ends_in {
            true => q,
            false => p + step * (nearest + half).clamp(0.0, 1.0),
        };
        if !starts_in {
            self.angle += angle(start, middle + enter);
            self.come_in(enter);
        }
        self.polygon += enter.perp_dot(leave);
        if !ends_in {
            self.left = Some(leave);
            self.angle = angle(middle + leave, middle + q);
        }
    }

    fn come_in(&mut self, at: DVec2) {
        match self.left {
            Some(left) => self.close(left, at, self.angle),
            None => self.first = Some((self.angle, at)),
        }
        self.angle = 0.0;
    }

    fn close(&mut self, left: DVec2, at: DVec2, angle: f64) {
        self.polygon += left.perp_dot(at);
        self.segments += segment(angle);
    }

    /// Area in units of the squared radius.
    fn area(mut self) -> f64 {
        match (self.left, self.first) {
            (Some(left), Some((before, at))) => self.close(left, at, self.angle + before),
            // The outline started inside and has re-entered.
            (Some(_), None) => {}
            // No side meets the circle: it lies entirely inside the parallelogram or entirely
            // outside.
            (None, _) => return if self.angle > PI { PI } else { 0.0 },
        }
        self.polygon / 2.0 + self.segments
    }
}

/// Signed angle from `a` to `b`, -pi to pi.
fn angle(a: DVec2, b: DVec2) -> f64 {
    a.perp_dot(b).atan2(a.dot(b))
}

/// Area between an arc of the unit circle and its chord, (x - sin x) / 2.
fn segment(x: f64) -> f64 {
    if x.abs() < SMALL {
        // Series up to x^15, accurate to rounding.
        let z = x * x;
        let tail = [210.0, 156.0, 110.0, 72.0, 42.0, 20.0];
        let series = tail.into_iter().fold(1.0, |sum, over| 1.0 - z / over * sum);
        return x * z / 12.0 * series;
    }
    (x - x.sin()) / 2.0
}

/// A convex polygon to be clipped.
struct Polygon {
    corners: [DVec2; 8],
    count: usize,
}

impl Polygon {
    fn new(corners: [DVec2; 4]) -> Self {
        let mut all = [DVec2::ZERO; 8];
        all[..4].copy_from_slice(&corners);
        Self {
            corners: all,
            count: 4,
        }
    }

    /// Clips the polygon to the half-plane `p . along <= offset` (Sutherland and Hodgman 1974).
    /// Each cut adds at most one corner.
    fn cut(&mut self, along: DVec2, offset: f64) {
        let mut kept = [DVec2::ZERO; 8];
        let mut count = 0;
        let mut keep = |corner: DVec2| {
            if count < kept.len() {
                kept[count] = corner;
                count += 1;
            }
        };
        for i in 0..self.count {
            let (p, q) = (self.corners[i], self.corners[(i + 1) % self.count]);
            let (over_p, over_q) = (p.dot(along) - offset, q.dot(along) - offset);
            if over_p <= 0.0 {
                keep(p);
            }
            if (over_p <= 0.0) != (over_q <= 0.0) {
                keep(p + (q - p) * (over_p / (over_p - over_q)));
            }
        }
        (self.corners, self.count) = (kept, count);
    }

    fn area(&self) -> f64 {
        let from = self.corners[0];
        let corners = &self.corners[..self.count];
        let twice = |pair: &[DVec2]| (pair[0] - from).perp_dot(pair[1] - from);
        corners.windows(2).map(twice).sum::<f64>() / 2.0
    }
}
