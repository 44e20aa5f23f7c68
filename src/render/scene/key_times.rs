//! Key instants: times at which a moving scene is traced, so that its geometry can be interpolated
//! between them. They depend on the scene and on device time only, never on requests.

use super::world::World;

/// Distances in nanoseconds between key instants, in the order in which they are tried. Each divides
/// the previous one, so that spans share key instants. A shorter distance than the last would not
/// exceed the time between two exposures.
pub(crate) const SPACINGS_NS: [u64; 5] =
    [200_000_000, 100_000_000, 50_000_000, 25_000_000, 12_500_000];
/// Number of instants in a span at which motion is compared with the parabola through the key
/// instants.
const PROBES: u32 = 32;

/// Three equidistant key instants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Span {
    start_ns: u64,
    spacing_ns: u64,
}

impl Span {
    /// Returns the span that contains a device time.
    pub(crate) fn around(time_ns: f64, spacing_ns: u64) -> Self {
        let length_ns = 2 * spacing_ns;
        let number = (time_ns.max(0.0) as u64) / length_ns;
        Self {
            start_ns: number * length_ns,
            spacing_ns,
        }
    }

    /// Returns the key instants in nanoseconds of device time.
    pub(crate) fn times_ns(self) -> [u64; 3] {
        [0, 1, 2].map(|k| self.start_ns.saturating_add(k * self.spacing_ns))
    }

    /// Returns the time between two key instants in nanoseconds.
    pub(crate) fn spacing_ns(self) -> u64 {
        self.spacing_ns
    }

    /// Converts a device time to a position in the span: -1, 0 and 1 at the key instants.
    pub(crate) fn place(self, time_ns: f64) -> f64 {
        (time_ns - self.start_ns as f64) / self.spacing_ns as f64 - 1.0
    }
}

/// Upper bounds of the motion of a scene within a span, in radians as seen from the camera.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpanMotion {
    /// Maximum motion of any point relative to the nearer of the two adjacent key instants.
    pub(crate) reach_rad: f64,
    /// Maximum distance of any point from the parabola through the point's positions at the key
    /// instants.
    pub(crate) off_rad: f64,
    /// Maximum second difference of the positions of any point at the key instants.
    pub(crate) bend_rad: f64,
}

impl World {
    /// Returns the bounds of all motion within a span.
    pub(crate) fn span_motion(&self, span: Span) -> SpanMotion {
        let states = span.times_ns().map(|time| self.state(time as f64));
        let [first, middle, last] = &states;
        let mut motion = SpanMotion {
            reach_rad: 0.0,
            off_rad: 0.0,
            bend_rad: self.displacement_rad(&[(1.0, first), (1.0, last), (-2.0, middle)]),
        };
        for k in 0..PROBES {
            // Multiples of the golden ratio fill the span evenly and do not alias with periodic
            // motion.
            let share = (f64::from(k) + 0.5) * 0.618_033_988_749_894_9 % 1.0;
            let length_ns = 2.0 * span.spacing_ns as f64;
            let state = self.state(span.start_ns as f64 + share * length_ns);
            let s = 2.0 * share - 1.0;
            let [a, b, c] = weights(s);
            let off = [(1.0, &state), (-a, first), (-b, middle), (-c, last)];
            let near = if s < 0.0 { first } else { last };
            let reach = self.way_rad(near, &state).min(self.way_rad(middle, &state));
            motion.off_rad = motion.off_rad.max(self.displacement_rad(&off));
            motion.reach_rad = motion.reach_rad.max(reach);
        }
        motion
    }

    /// Returns whether nothing moves within the shortest span around a device time.
    pub(crate) fn rests(&self, time_ns: f64) -> bool {
        let span = Span::around(time_ns, SPACINGS_NS[SPACINGS_NS.len() - 1]);
        let now = self.state(time_ns);
        let same = |time| self.state(time as f64) == now;
        span.times_ns().into_iter().all(same) && self.span_motion(span).reach_rad == 0.0
    }
}

/// Returns the weights with which a parabola through values at positions -1, 0 and 1 gives its value
/// at `s`.
fn weights(s: f64) -> [f64; 3] {
    [0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)]
}
