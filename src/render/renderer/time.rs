//! Motion within an exposure: the light of a moving scene is the mean over several instants, each
//! with its own geometry.

use super::Renderer;
use crate::Term;
use crate::scene::{Moment, World};
use crate::schedule::Light;
use crate::shot::{Shot, Shutter};

/// Maximum motion during an exposure, in pixels, for which one instant is used. For fringes with a
/// period of ten pixels, the neglected loss of modulation is 3e-4.
const STILL_PX: f64 = 0.125;

/// Returns whether the camera sees motion between the start of the first row's exposure and the end
/// of the last row's. Motion is summed over the instants into which the exposure would be divided,
/// so that oscillations are detected.
fn goes(world: &World, shot: &Shot, shutter: Shutter, count: u32, rad_per_px: f64) -> bool {
    let whole_ns = shot.exposure_ns as f64 + shutter.skew_ns() as f64;
    let at = |i: u32| {
        let share = f64::from(i) / f64::from(count);
        world.state(shot.start_ns as f64 + whole_ns * share)
    };
    let (mut last, mut way) = (at(0), 0.0);
    for i in 1..=count {
        let next = at(i);
        way += world.way_rad(&last, &next);
        last = next;
    }
    way > STILL_PX * rad_per_px
}

/// Divides a shot's exposure into `count` parts whose lengths are equal to the nanosecond, each with
/// the scene at its midpoint. This is the midpoint rule, whose error falls with the square of the
/// number of parts. Parts with the same scene state are merged.
fn parts(world: &World, shot: &Shot, shutter: Shutter, count: u32) -> Vec<(Instant, Shot)> {
    let cut = |i: u32| (u128::from(shot.exposure_ns) * u128::from(i) / u128::from(count)) as u64;
    let mut parts: Vec<(Instant, Shot)> = Vec::new();
    for i in 0..count {
        let (from, length_ns) = (cut(i), cut(i + 1) - cut(i));
        let start_ns = shot.start_ns.saturating_add(from);
        let middle_ns = start_ns as f64 + length_ns as f64 / 2.0;
        let moment = Moment::new(world, middle_ns, shutter);
        match parts.last_mut() {
            Some(((last, _), part)) if *last == moment => part.exposure_ns += length_ns,
            _ => parts.push((
                (moment, middle_ns),
                Shot {
                    start_ns,
                    exposure_ns: length_ns,
                    ..shot.clone()
                },
            )),
        }
    }
    parts
}

/// Moment of a part of an exposure, and its device time in nanoseconds.
type Instant = (Moment, f64);

impl Renderer {
    /// Returns the instants that represent a shot's exposure, each with the part of the shot that it
    /// represents; returns a single instant if nothing moves.
    pub(super) fn instants(&self, shot: &Shot) -> Vec<(Option<Instant>, Shot)> {
        if !self.plan.has(Term::Motion) {
            return vec![(None, shot.clone())];
        }
        let shutter = match self.plan.has(Term::RollingShutter) {
            true => shot.shutter,
            false => Shutter::default(),
        };
        let world = self.worlds.any();
        let most = self.options.time_samples;
        let camera = &self.profile.camera;
        let rad_per_px = 1.0 / camera.view().lens.focal_px.max_element();
        let goes = goes(world, shot, shutter, most, rad_per_px);
        let parts = parts(world, shot, shutter, if goes { most } else { 1 });
        let some = |(instant, part)| (Some(instant), part);
        parts.into_iter().map(some).collect()
    }

    /// Returns the light of a shot, computed from the current geometry if one instant represents
    /// the exposure.
    pub(super) fn light(&mut self, shot: &Shot) -> Light {
        let parts = self.instants(shot);
        if let [(instant, _)] = parts.as_slice() {
            if let Some(instant) = instant {
                self.go_to_instant(instant);
            }
            return Light::Scheduled(self.schedule(shot));
        }
        let camera = &self.profile.camera;
        let mut sum = vec![0.0f32; camera.width_px as usize * camera.height_px as usize];
        for (instant, part) in &parts {
            if self.worlds.stop.is_asked() {
                break;
            }
            if let Some(instant) = instant {
                self.go_to_instant(instant);
            }
            let schedule = self.schedule(part);
            let add = |_, electrons: &mut [f32], sum: &mut [f32]| {
                for (sum, electrons) in sum.iter_mut().zip(electrons) {
                    *sum += *electrons;
                }
            };
            self.electrons(&schedule, add, &mut sum, 1);
        }
        Light::Summed(sum)
    }

    /// Moves the scene to its state at a device time, if anything moves.
    pub(super) fn go_to_time(&mut self, time_ns: u64) {
        if self.plan.has(Term::Motion) {
            let state = self.worlds.any().state(time_ns as f64);
            self.go_to(&Moment::Instant(state), None);
        }
    }

    /// Moves the scene to an instant of an exposure. If the scene is at rest at that instant, its
    /// geometry is traced and not interpolated.
    pub(super) fn go_to_instant(&mut self, (moment, time_ns): &Instant) {
        let moves = || !self.worlds.any().rests(*time_ns);
        let between = (self.interpolates() && moves()).then_some(*time_ns);
        self.go_to(moment, between);
    }

    /// Moves the scene to a moment; the geometry is kept if the scene is already there. If a device
    /// time is given, the geometry is interpolated if possible.
    fn go_to(&mut self, moment: &Moment, between_ns: Option<f64>) {
        let known = self.moment.as_ref();
        if known.is_none_or(|(last, time_ns)| last != moment || *time_ns != between_ns) {
            self.worlds.set(moment);
            self.moment = Some((moment.clone(), between_ns));
            self.outdate_moment();
        }
    }
}

/// Returns the device time in nanoseconds at which the ground truth of a moving scene is evaluated:
/// midway between the start of a sequence's first exposure and the end of its last exposure, over
/// all rows of a rolling shutter; 0 for an empty sequence.
pub(super) fn middle_ns<'a>(shots: impl Iterator<Item = &'a Shot>) -> u64 {
    let ends = |shot: &Shot| (shot.start_ns, shot.end_ns());
    shots
        .map(ends)
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        .map_or(0, |(first, last)| first + (last - first) / 2)
}
