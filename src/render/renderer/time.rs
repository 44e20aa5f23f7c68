//! Time inside an exposure: the light of a scene that moves is the mean over instants, each of which
//! has its own geometry.

use super::Renderer;
use crate::Term;
use crate::schedule::Schedule;
use crate::shot::Shot;
use crate::shot::Shutter;
use crate::world::World;
use crate::worlds::Moment;

/// What a shot's pixels see of light.
pub(super) enum Light {
    /// In the geometry at hand.
    Scheduled(Schedule),
    /// Mean electrons of the pixels, summed over instants.
    Summed(Vec<f32>),
}

/// An exposure in which nothing goes farther than this share of a pixel is looked at once: of fringes
/// of ten pixels' period that leaves 3e-4 of their modulation unsaid.
const STILL_PX: f64 = 0.125;

/// Whether the camera sees something go from the first row's start to the last row's end. What swings
/// to and fro goes all the way, so that it is asked for at each of the instants that would be looked
/// at.
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

/// The parts of a shot's exposure, as even as nanoseconds allow, each with the scene in its middle:
/// the midpoint rule, whose error falls as the square of their number. Parts in which the scene is
/// the same are one.
fn parts(world: &World, shot: &Shot, shutter: Shutter, count: u32) -> Vec<(Moment, Shot)> {
    let cut = |i: u32| (u128::from(shot.exposure_ns) * u128::from(i) / u128::from(count)) as u64;
    let mut parts: Vec<(Moment, Shot)> = Vec::new();
    for i in 0..count {
        let (from, length_ns) = (cut(i), cut(i + 1) - cut(i));
        let start_ns = shot.start_ns.saturating_add(from);
        let middle_ns = start_ns as f64 + length_ns as f64 / 2.0;
        let moment = Moment::new(world, middle_ns, shutter);
        match parts.last_mut() {
            Some((last, part)) if *last == moment => part.exposure_ns += length_ns,
            _ => parts.push((
                moment,
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

impl Renderer {
    /// The instants that stand for a shot's exposure, each with its part of it: one, of any time,
    /// where nothing moves.
    pub(super) fn instants(&self, shot: &Shot) -> Vec<(Option<Moment>, Shot)> {
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
        let pitch_mm = camera.sensor_width_mm / f64::from(camera.width_px);
        let goes = goes(
            world,
            shot,
            shutter,
            most,
            pitch_mm / camera.focal_length_mm,
        );
        let parts = parts(world, shot, shutter, if goes { most } else { 1 });
        let some = |(moment, part)| (Some(moment), part);
        parts.into_iter().map(some).collect()
    }

    /// The light of a shot, with the geometry at hand where one instant stands for the exposure.
    pub(super) fn light(&mut self, shot: &Shot) -> Light {
        let parts = self.instants(shot);
        if let [(moment, _)] = parts.as_slice() {
            if let Some(moment) = moment {
                self.go_to(moment);
            }
            return Light::Scheduled(self.schedule(shot));
        }
        let camera = &self.profile.camera;
        let mut sum = vec![0.0f32; camera.width_px as usize * camera.height_px as usize];
        for (moment, part) in &parts {
            if let Some(moment) = moment {
                self.go_to(moment);
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

    /// Takes the scene to where it is at a device time, if anything in it moves.
    pub(super) fn go_to_time(&mut self, time_ns: u64) {
        if self.plan.has(Term::Motion) {
            let state = self.worlds.any().state(time_ns as f64);
            self.go_to(&Moment::Instant(state));
        }
    }

    /// The geometry of a moment that is at hand stays.
    pub(super) fn go_to(&mut self, moment: &Moment) {
        if self.moment.as_ref() != Some(moment) {
            self.worlds.set(moment);
            self.moment = Some(moment.clone());
            self.outdate();
        }
    }
}

/// The device time in nanoseconds that the truth of a scene that moves is taken at: half way from
/// the start of a sequence's first exposure to the end of its last, of all rows of a rolling shutter;
/// 0 of none.
pub(super) fn middle_ns<'a>(shots: impl Iterator<Item = &'a Shot>) -> u64 {
    let ends = |shot: &Shot| (shot.start_ns, shot.end_ns());
    shots
        .map(ends)
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        .map_or(0, |(first, last)| first + (last - first) / 2)
}
