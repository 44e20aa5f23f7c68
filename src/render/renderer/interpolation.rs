//! Interpolation of a moving scene's geometry between key instants: selects the spans that are
//! interpolated, and measures the error.

use super::Renderer;
use super::keys::Keys;
use crate::Term;
use crate::exposure::GeometryBuffer;
use crate::scene::{Moment, SPACINGS_NS, Span, Surface};
use crate::transport::{Between, ImageMotion, geometry};
use crate::truth::Truth;
use serde::Serialize;
use std::sync::Arc;

/// Maximum fraction of the pixels that may be traced at every instant of a span. If more are needed,
/// shorter distances between key instants are tried.
const MOST_TRACED: f64 = 0.06;
/// The same maximum for the shortest distance between key instants.
const MOST_TRACED_LAST: f64 = 0.3;
/// Maximum number of pixels of a camera whose geometry is interpolated: on skin, all key instants that
/// are kept take about 1 kB per pixel.
const MOST_PIXELS: usize = 2_500_000;
/// Maximum size of a key instant in bytes; up to ten key instants are kept. Key instants with wide
/// blur may exceed it.
const MOST_BYTES: usize = 400_000_000;
/// Maximum fraction of the lit gather points at which indirect light may differ visibly between two key
/// instants.
const MOST_DIFFERENT: f64 = 1e-2;
/// Minimum duration of a span, from the first to the last key instant, in exposures. Two key
/// instants per span cost as much as four interpolated frames.
const FEWEST_FRAMES: f64 = 6.0;
/// Maximum motion of any point from the nearer key instant, in camera pixels.
const MOST_REACH_PX: f64 = 3.0;

/// Interpolation of a moving scene's geometry at an instant, and its error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interpolation {
    /// Time between key instants in milliseconds.
    pub spacing_ms: f64,
    /// Fraction of the pixels that is traced at this instant.
    pub traced: f64,
    /// Number of pixels that see the same object, and are lit, both in interpolated and in traced
    /// geometry.
    pub pixels: usize,
    /// Median distance between interpolated and traced projector coordinates in projector pixels. If
    /// patterns vary along both axes, the distance is over both.
    pub median_px: f64,
    /// 99.9th percentile of this distance.
    pub most_px: f64,
    /// Maximum of this distance.
    pub worst_px: f64,
    /// Mean of the signed differences between interpolated and traced coordinates, in projector
    /// pixels.
    pub mean_px: f64,
    /// Number of pixels whose object or projector light differs between interpolated and traced
    /// geometry.
    pub missed: usize,
}

impl Renderer {
    /// Returns whether the options and the plan permit interpolated geometry.
    pub(super) fn interpolates(&self) -> bool {
        self.plan.has(Term::Motion)
            && self.options.motion_tolerance_px > 0.0
            && self.options.samples == 1
            && self.pixel_count() <= MOST_PIXELS
            && self.gpu.is_none()
            && !self.plan.has(Term::DepthOfField)
    }

    /// Returns the interpolation from a first to a last device time in nanoseconds, over the longest span
    /// in which the motion is smooth enough. Returns `None` if there is no such span, so that the frame
    /// must be traced.
    pub(super) fn between(&mut self, [first_ns, last_ns]: [f64; 2]) -> Option<Arc<Between>> {
        let shortest_ns = FEWEST_FRAMES / 2.0 * 1e3 * self.profile.camera.shortest_period_us();
        let asked = self.worlds.stop.times();
        let is_long = |spacing_ns: &u64| *spacing_ns as f64 >= shortest_ns;
        for spacing_ns in SPACINGS_NS.into_iter().take_while(is_long) {
            let span = Span::around(first_ns, spacing_ns);
            // The rows of a rolling shutter may see more than one span.
            if span != Span::around(last_ns, spacing_ns) {
                return None;
            }
            let found = match self.keys.decided(span) {
                Some(found) => found,
                None => {
                    let found = self.interpolate(span);
                    let stop = &self.worlds.stop;
                    if stop.is_asked() || stop.times() != asked {
                        // Key instants may be incomplete.
                        self.keys = Keys::default();
                        return None;
                    }
                    self.keys.decide(span, found.clone());
                    found
                }
            };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Returns the interpolation within a span; `None` if the motion in the span is not smooth
    /// enough.
    fn interpolate(&mut self, span: Span) -> Option<Arc<Between>> {
        let world = self.worlds.any();
        let motion = world.span_motion(span);
        let focal = |lens: &phasmid_geometry::Lens| lens.focal_px.max_element();
        let tolerance_px = self.options.motion_tolerance_px;
        let off_px = motion.off_rad * focal(&self.optics.projector.lens);
        let motion = ImageMotion {
            reach_px: motion.reach_rad * focal(&self.optics.camera.lens),
            bend_px: motion.bend_rad * focal(&self.optics.camera.lens),
        };
        let too_far = self.plan.has(Term::AlbedoMaps) && !motion.follows_albedo();
        if too_far || !(off_px <= tolerance_px && motion.reach_px <= MOST_REACH_PX) {
            return None;
        }
        if self.is_oversized(span) {
            return None;
        }
        let times_ns = span.times_ns();
        let kept = times_ns.map(|time_ns| self.keys.traced(time_ns));
        let keys: [_; 3] = std::array::from_fn(|k| match &kept[k] {
            Some(key) => key.clone(),
            None => self.key(times_ns[k]),
        });
        if kept.iter().any(Option::is_none) {
            self.return_to_moment();
        }
        if self.worlds.stop.is_asked() {
            return None;
        }
        let world = self.worlds.any();
        let limit_px = tolerance_px as f32;
        let between = Between::new(span, keys, world, motion, limit_px);
        let most = match span.spacing_ns() == SPACINGS_NS[SPACINGS_NS.len() - 1] {
            true => MOST_TRACED_LAST,
            false => MOST_TRACED,
        };
        let indirect = self
            .optics
            .interreflection
            .map(|wanted| wanted.step_px as usize);
        let indirect = indirect.filter(|_| self.plan.has(Term::Interreflection));
        let steady = |step_px| between.indirect_difference(step_px) <= MOST_DIFFERENT;
        (between.traced() <= most && indirect.is_none_or(steady)).then(|| Arc::new(between))
    }

    /// Returns whether key instants around a span take too much memory. The answer is the same for
    /// all spans that begin in the same longest span, so it does not depend on the order of frames.
    fn is_oversized(&mut self, span: Span) -> bool {
        let terms = [
            Term::Subsurface,
            Term::ProjectorDefocus,
            Term::Interreflection,
        ];
        if !terms.into_iter().any(|term| self.plan.has(term)) {
            return false;
        }
        let [start_ns, ..] = span.times_ns();
        let [first_ns, ..] = Span::around(start_ns as f64, SPACINGS_NS[0]).times_ns();
        if let Some(known) = self.keys.oversized(first_ns) {
            return known;
        }
        let key = self.keys.traced(first_ns).unwrap_or_else(|| {
            let key = self.key(first_ns);
            self.return_to_moment();
            key
        });
        let found = key.bytes() > MOST_BYTES;
        self.keys.weigh(first_ns, found);
        found
    }

    /// Moves the scene back to its current moment after key instants have been traced.
    fn return_to_moment(&mut self) {
        if let Some((moment, _)) = &self.moment {
            self.worlds.set(moment);
        }
    }

    /// Traces the geometry at a key instant. Moves the scene there.
    fn key(&mut self, time_ns: u64) -> Arc<GeometryBuffer> {
        let state = self.worlds.any().state(time_ns as f64);
        self.worlds.set(&Moment::Instant(state));
        let mut buffer = GeometryBuffer::default();
        geometry::key(&self.geometry_input(&self.pixel_rays()), &mut buffer);
        let buffer = Arc::new(buffer);
        self.keys.keep(time_ns, buffer.clone());
        buffer
    }

    /// Sets the error in projector pixels up to which geometry is interpolated; see
    /// [`Options::motion_tolerance_px`](crate::Options).
    pub fn set_motion_tolerance(&mut self, pixels: f64) {
        self.options.motion_tolerance_px = pixels;
        self.invalidate();
    }

    /// Returns how geometry is interpolated at a device time in nanoseconds, and its differences
    /// from the traced geometry; `None` if the instant is traced.
    pub fn interpolation(&mut self, time_ns: u64) -> Option<Interpolation> {
        if !self.interpolates() {
            return None;
        }
        let state = self.worlds.any().state(time_ns as f64);
        self.go_to_instant(&(Moment::Instant(state), time_ns as f64));
        let (_, Some(instant_ns)) = self.moment.clone()? else {
            return None;
        };
        self.prepare();
        let between = self.between([instant_ns; 2])?;
        let found = self.buffer.clone();
        self.go_to_time(time_ns);
        self.prepare();
        let (traced, world) = (&self.buffer, self.worlds.any());
        let object = |map: &GeometryBuffer, i: usize| match map.flags[i] & Truth::SEEN {
            0 => None,
            _ => Some(world.object(Surface(map.surface[i]))),
        };
        let lit = |map: &GeometryBuffer, i: usize| map.flags[i] & Truth::LIT != 0;
        let differs = |i: &usize| {
            object(&found, *i) != object(traced, *i) || lit(&found, *i) != lit(traced, *i)
        };
        let pixels = 0..found.x.len();
        let alike: Vec<_> = pixels
            .clone()
            .filter(|i| lit(traced, *i) && !differs(i))
            .collect();
        let mut errors = Vec::new();
        if self.plan.has(Term::FootprintX) {
            errors.extend(alike.iter().map(|&i| found.x[i] - traced.x[i]));
        }
        if self.plan.has(Term::FootprintY) {
            errors.extend(alike.iter().map(|&i| found.y[i] - traced.y[i]));
        }
        let mean_px = errors.iter().map(|e| f64::from(*e)).sum::<f64>() / errors.len() as f64;
        let mut sizes: Vec<f32> = errors.iter().map(|e| e.abs()).collect();
        sizes.sort_unstable_by(f32::total_cmp);
        let quantile = |share: f64| {
            let last = sizes.len().saturating_sub(1) as f64;
            sizes
                .get((share * last).ceil() as usize)
                .map_or(f64::NAN, |v| f64::from(*v))
        };
        Some(Interpolation {
            spacing_ms: between.spacing_ns() as f64 * 1e-6,
            traced: between.traced(),
            pixels: alike.len(),
            median_px: quantile(0.5),
            most_px: quantile(0.999),
            worst_px: quantile(1.0),
            mean_px,
            missed: pixels.filter(differs).count(),
        })
    }

    /// Fills the buffer with the geometry at a device time: by interpolation between key instants if
    /// possible, else by tracing.
    pub(super) fn trace_between(&mut self, time_ns: f64, buffer: &mut GeometryBuffer) {
        let moment = self.moment.as_ref().map(|(moment, _)| moment.clone());
        let rows = match &moment {
            Some(Moment::Rows(rows)) => Some(*rows),
            _ => None,
        };
        let row_time_ns = |row: usize| rows.map_or(time_ns, |rows| rows.time_ns(row as u32));
        let last_row = self.profile.camera.height_px as usize - 1;
        let between = self.between([row_time_ns(0), row_time_ns(last_row)]);
        match between {
            Some(between) => {
                between.run(
                    row_time_ns,
                    &self.geometry_input(&self.pixel_rays()),
                    buffer,
                );
            }
            None => self.trace(buffer),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Options;
    use crate::pattern_image::PatternImage;
    use crate::shot::{Shot, Shutter};
    use phasmid_pattern::Axis;
    use phasmid_profile::{Profile, Scene};

    const PLANE: &str =
        "[[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1200]\nalbedo = 0.5\n";

    fn scene(objects: &str) -> Scene {
        let text = format!("name = \"s\"\ndescription = \"\"\n{PLANE}{objects}");
        Scene::parse(&text, "test").unwrap()
    }

    fn renderer(profile: &str, scene: &Scene, motion_tolerance_px: f64) -> Renderer {
        let mut profile = Profile::load(profile).unwrap();
        profile.camera.exposure_us = 2_000.0;
        let options = Options {
            motion_tolerance_px,
            ..Options::default()
        };
        let mut renderer = Renderer::with_options(&profile, scene, 1, options).unwrap();
        renderer.force(Term::FootprintX, true);
        renderer
    }

    fn shot(k: u64, start_ns: u64) -> Shot {
        let row = (0..854).map(|x| (x % 16 * 16) as u16).collect();
        Shot {
            noise_id: k,
            pattern_image: Some(Arc::new(PatternImage::Row(Axis::X, row))),
            light: 1.0,
            start_ns,
            exposure_ns: 8_000_000,
            ..Shot::default()
        }
    }

    fn object(shape: &str, speed_mm_s: f64, turn_deg: f64) -> Scene {
        let [x, z] = [0.8 * speed_mm_s, -0.6 * speed_mm_s];
        scene(&format!(
            "[[object]]\nshape = {shape}\nposition_mm = [0, 0, 1000]\nalbedo = 0.7\n\
             motion = {{ period_s = 4.0, keyframes = [{{ time_s = 0.0 }}, {{ time_s = 1.0, \
             position_mm = [{x}, 0.0, {z}], rotation_deg = [0.0, {turn_deg}, 0.0] }}] }}\n"
        ))
    }

    const TORSO: &str = "{ kind = \"torso\", triangles = 20000 }";

    /// The tolerance holds for slow and fast rigid motions, with and without rotation; for a rod and
    /// its shadow that move by more than the rod's diameter between key instants; and for breathing.
    #[test]
    fn interpolated_coordinates_stay_within_the_tolerance_and_no_edge_is_missed() {
        let rod = "{ kind = \"cylinder\", radius_mm = 2.0, length_mm = 300.0 }";
        let sphere = "{ kind = \"sphere\", radius_mm = 150.0 }";
        let cases = [
            ("webcam-grey", object(TORSO, 1.0, 0.0)),
            ("webcam-grey", object(TORSO, 10.0, 1.0)),
            ("webcam-grey", object(TORSO, 100.0, 0.0)),
            ("webcam-grey", object(sphere, 30.0, 0.0)),
            ("webcam-grey", object(rod, 60.0, 0.0)),
            ("sgrt-pod", Scene::load("treatment-room").unwrap()),
        ];
        for (k, (profile, scene)) in cases.into_iter().enumerate() {
            let mut renderer = renderer(profile, &scene, 0.01);
            for time_ns in [513_000_000, 1_987_000_000] {
                let found = renderer.interpolation(time_ns);
                println!("{k} at {time_ns}: {found:?}");
                let found = found.unwrap_or_else(|| panic!("case {k} is traced"));
                assert!(found.pixels > 10_000, "{found:?}");
                assert!(
                    found.most_px <= 0.01 && found.worst_px <= 0.1,
                    "{k} {found:?}"
                );
                assert!(found.mean_px.abs() <= 0.002, "{k} {found:?}");
                assert!(found.missed <= found.pixels / 20_000, "{k} {found:?}");
                assert!(found.traced <= 0.3, "{k} {found:?}");
            }
        }
    }

    /// The light of interpolated frames, including levels on skin and the samples of mixed pixels, is that
    /// of traced frames. The camera's noise at full light is 2.3 digital numbers.
    #[test]
    fn interpolated_light_is_that_of_traced_frames() {
        let fringes = |x: u16| (127.5 + 127.5 * (f64::from(x) * 0.39).cos()).round() as u16;
        let stripes = |x: u16| x / 4 % 2 * 255;
        let scene = Scene::load("treatment-room").unwrap();
        let [mut between, mut traced] = [0.01, 0.0].map(|px| renderer("sgrt-pod", &scene, px));
        for time_ns in [413_000_000, 1_987_000_000] {
            assert!(between.interpolation(time_ns).is_some());
            for row in [
                (0..912).map(fringes).collect(),
                (0..912).map(stripes).collect(),
            ] {
                let shot = Shot {
                    pattern_image: Some(Arc::new(PatternImage::Row(Axis::X, row))),
                    exposure_ns: 2_560_000,
                    ..shot(0, time_ns)
                };
                let (found, wanted) = (between.expected_dn(&shot), traced.expected_dn(&shot));
                assert!(found != wanted, "nothing was interpolated");
                let error = |(a, b): (&f32, &f32)| (a - b).abs();
                let mut errors: Vec<f32> = found.iter().zip(&wanted).map(error).collect();
                errors.sort_unstable_by(f32::total_cmp);
                let at = |share: f64| errors[(share * errors.len() as f64) as usize];
                let quantiles = [0.99, 0.999, 0.9999].map(at);
                println!("{quantiles:?}");
                let limits = [0.4, 1.5, 4.0];
                let within = quantiles.iter().zip(limits).all(|(q, limit)| *q <= limit);
                assert!(within, "{quantiles:?}");
            }
        }
    }

    /// Interpolated frames have the indirect light of projector and lamp, and the ink of a board.
    #[test]
    fn interpolated_indirect_light_and_albedo_are_those_of_traced_frames() {
        let motion = "motion = { period_s = 4.0, keyframes = [{ time_s = 0.0 }, { time_s = 1.0, \
                      position_mm = [4.0, 0.0, -5.0], rotation_deg = [0.0, 1.0, 0.0] }] }\n";
        let corner = format!(
            "[[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [200, 0, 1100]\n\
             rotation_deg = [0, 60, 0]\nalbedo = 0.9\n\
             [[object]]\nshape = {TORSO}\nposition_mm = [-60, 0, 1000]\nalbedo = 0.7\n{motion}\
             [[light]]\nposition_mm = [-900, -300, 300]\nkind = \"point\"\nintensity_w_sr = 0.1\n\
             [interreflection]\nsamples = 64\nstep_px = 8\n"
        );
        let board = format!(
            "[[object]]\nshape = {{ kind = \"board\", board = {{ pattern = \"dots\", columns = 25, \
             rows = 19, pitch_mm = 24.0, dot_mm = 10.0, marker_mm = 20.0 }} }}\n\
             position_mm = [0, 0, 1000]\nalbedo = 0.8\n{motion}"
        );
        for (name, objects, most) in [
            ("corner", corner, [0.3, 1.5, 6.0]),
            ("board", board, [0.1, 0.3, 2.0]),
        ] {
            let scene = scene(&objects);
            let [mut between, mut traced, mut without] =
                [0.01, 0.0, 0.0].map(|px| renderer("webcam-grey", &scene, px));
            without.force(Term::Interreflection, false);
            without.force(Term::AlbedoMaps, false);
            for time_ns in [413_000_000, 1_987_000_000] {
                let shot = shot(0, time_ns);
                let [found, wanted, direct] = [&mut between, &mut traced, &mut without]
                    .map(|renderer| renderer.expected_dn(&shot));
                assert!(found != wanted, "{name} is not interpolated");
                let errors = |found: &[f32]| {
                    let error = |(a, b): (&f32, &f32)| (a - b).abs();
                    let mut errors: Vec<f32> = found.iter().zip(&wanted).map(error).collect();
                    errors.sort_unstable_by(f32::total_cmp);
                    [0.99, 0.999, 1.0].map(|share| errors[(share * 307_199.0) as usize])
                };
                let (errors, omitted) = (errors(&found), errors(&direct));
                println!("{name} {errors:?} without {omitted:?}");
                let within = errors.iter().zip(most).all(|(error, most)| *error < most);
                assert!(within, "{name} {errors:?}");
                assert!(omitted[0] > 20.0 * errors[0], "{name} {omitted:?}");
            }
        }
    }

    /// Each row of a rolling shutter is interpolated at its own time.
    #[test]
    fn rows_of_a_rolling_shutter_are_interpolated_at_their_own_times() {
        let cases = [
            ("webcam-grey", object(TORSO, 10.0, 0.0)),
            ("sgrt-pod", Scene::load("treatment-room").unwrap()),
        ];
        for (profile, scene) in cases {
            let [mut between, mut traced] = [0.01, 0.0].map(|px| {
                let mut profile = Profile::load(profile).unwrap();
                profile.camera.line_time_us = 30.0;
                profile.camera.exposure_us = 2_000.0;
                profile.camera.readout_us = None;
                let options = Options {
                    motion_tolerance_px: px,
                    ..Options::default()
                };
                Renderer::with_options(&profile, &scene, 1, options).unwrap()
            });
            let shutter = Shutter {
                line_time_ns: 30_000,
                first_row: 0,
                rows: 480,
            };
            let shot = Shot {
                shutter,
                ..shot(0, 421_000_000)
            };
            let [mut errors, mut delayed] = [const { Vec::new() }; 2];
            for renderer in [&mut between, &mut traced] {
                renderer.make_ready(std::slice::from_ref(&shot));
                renderer.expose(&shot);
            }
            let (found, wanted) = (&between.buffer, &traced.buffer);
            assert!(
                found.projected != wanted.projected,
                "nothing was interpolated"
            );
            let lit = |map: &GeometryBuffer, i: usize| map.flags[i] & Truth::LIT != 0;
            let missed = (0..found.x.len())
                .filter(|i| lit(found, *i) != lit(wanted, *i))
                .count();
            let rolling: Vec<f32> = wanted.x.clone();
            for i in (0..found.x.len()).filter(|i| lit(found, *i) && lit(wanted, *i)) {
                errors.push((found.x[i] - wanted.x[i]).abs());
            }
            let global = Shot {
                shutter: Shutter::default(),
                ..shot.clone()
            };
            traced.expose(&global);
            for (i, x) in rolling.iter().enumerate().filter(|(_, x)| x.is_finite()) {
                let delay = (x - traced.buffer.x[i]).abs();
                delayed.push(if delay.is_nan() { 0.0 } else { delay });
            }
            for values in [&mut errors, &mut delayed] {
                values.sort_unstable_by(f32::total_cmp);
            }
            let at = |values: &[f32], share: f64| values[(share * values.len() as f64) as usize];
            println!(
                "{} {} {} {missed}",
                at(&errors, 0.999),
                errors[errors.len() - 1],
                at(&delayed, 0.9)
            );
            assert!(errors.len() > 10_000 && missed < 5, "{missed}");
            assert!(at(&errors, 0.999) < 0.01);
            assert!(at(&delayed, 0.9) > 0.01, "rows see the scene at one time");
        }
    }

    #[test]
    fn bytes_depend_on_device_time_only() {
        let scene = object(TORSO, 10.0, 1.0);
        let shot = |k: u64| shot(k, 300_000_000 + k * 37_000_000);
        let mut one = renderer("webcam-grey", &scene, 0.01);
        let forth: Vec<_> = (0..8).map(|k| one.expose(&shot(k)).data).collect();
        let mut other = renderer("webcam-grey", &scene, 0.01);
        for k in (0..8).rev() {
            other.truth_at(&[], shot(k).start_ns + 4_000_000);
            assert!(
                other.expose(&shot(k)).data == forth[k as usize],
                "frame {k}"
            );
        }
        let mut traced = renderer("webcam-grey", &scene, 0.0);
        let differing = (0..8).filter(|k| traced.expose(&shot(*k)).data != forth[*k as usize]);
        assert!(differing.count() > 4, "nothing was interpolated");
    }

    /// Patterns along y, shown before, change no frame of patterns along x.
    #[test]
    fn bytes_do_not_depend_on_earlier_patterns() {
        let mut profile = Profile::load("webcam-grey").unwrap();
        profile.projector.position_mm = [20.0, 210.0, 0.0];
        profile.camera.exposure_us = 2_000.0;
        let scene = object("{ kind = \"torso\", triangles = 1000 }", 10.0, 1.0);
        let frames = |earlier: bool| {
            let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
            if earlier {
                let pattern_image = PatternImage::Row(Axis::Y, (0..480).collect());
                renderer.expose(&Shot {
                    pattern_image: Some(Arc::new(pattern_image)),
                    ..shot(0, 200_000_000)
                });
            }
            let frame = |k: u64| renderer.expose(&shot(k, 300_000_000 + k * 61_000_000));
            (0..8).map(frame).collect::<Vec<_>>()
        };
        assert!(frames(false) == frames(true));
    }

    /// Without motion, the scene stays at its last instant and is traced.
    #[test]
    fn frames_without_motion_are_traced() {
        let scene = object(TORSO, 10.0, 1.0);
        let shot = shot(0, 300_000_000);
        let [mut between, mut traced] = [0.01, 0.0].map(|px| renderer("webcam-grey", &scene, px));
        assert!(between.expose(&shot) != traced.expose(&shot));
        for renderer in [&mut between, &mut traced] {
            renderer.force(Term::Motion, false);
        }
        assert!(between.expose(&shot) == traced.expose(&shot));
    }

    /// Frames equal traced frames for a scene at rest, for a scene that moves between two rests
    /// (while it rests), and for a scene that shakes too fast to be interpolated.
    #[test]
    fn where_nothing_is_interpolated_bytes_are_those_of_traced_frames() {
        let still = scene(&format!(
            "[[object]]\nshape = {TORSO}\nposition_mm = [0, 0, 1000]\nalbedo = 0.7\n"
        ));
        let rests = scene(&format!(
            "[[object]]\nshape = {TORSO}\nposition_mm = [0, 0, 1000]\nalbedo = 0.7\n\
             motion = {{ keyframes = [{{ time_s = 5.0 }}, {{ time_s = 6.0, position_mm = [9, 0, 0] }}] }}\n"
        ));
        let shakes = scene(&format!(
            "[[object]]\nshape = {TORSO}\nposition_mm = [0, 0, 1000]\nalbedo = 0.7\n\
             motion = {{ period_s = 0.0125, keyframes = [{{ time_s = 0 }}, {{ time_s = 0.005, \
             position_mm = [1, 0, 0] }}] }}\n"
        ));
        for scene in [still, rests, shakes] {
            let mut one = renderer("webcam-grey", &scene, 0.01);
            let mut other = renderer("webcam-grey", &scene, 0.0);
            for start_ns in [1_000_000_000, 7_004_000_000] {
                assert_eq!(one.interpolation(start_ns), None);
                let shot = shot(0, start_ns);
                assert!(one.expose(&shot) == other.expose(&shot));
            }
        }
    }

    #[test]
    fn a_placed_object_outdates_the_key_instants() {
        let scene = object(TORSO, 10.0, 0.0);
        let shot = shot(0, 250_000_000);
        let mut placed = renderer("webcam-grey", &scene, 0.01);
        placed.expose(&shot);
        placed
            .place(0, [0.0, 0.0, 1100.0], [5.0, 0.0, 0.0])
            .unwrap();
        let mut moved = scene.clone();
        moved.place(0, [0.0, 0.0, 1100.0], [5.0, 0.0, 0.0]).unwrap();
        let mut started = renderer("webcam-grey", &moved, 0.01);
        assert!(started.interpolation(shot.start_ns).is_some());
        assert!(placed.expose(&shot) == started.expose(&shot));
    }
}
