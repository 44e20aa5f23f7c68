//! Renderer of one camera in front of one scene: runs the passes that a shot needs.
//!
//! `indirect` chooses the settings for indirect light, `interpolation` interpolates between the
//! instants in `keys`, `news` opens the GPU and keeps notes for the user, `pending` submits frames
//! to the CPU or GPU, `time` divides an exposure of a moving scene into instants, `change` moves
//! objects at run time, and `truth` computes ground truth.

mod change;
mod indirect;
mod interpolation;
mod keys;
mod news;
mod pending;
mod time;
mod truth;

pub use indirect::IndirectLight;
pub use interpolation::Interpolation;
pub use pending::Pending;

use super::exposure::{GeometryBuffer, Optics, Table};
use super::gpu::{self, Passes};
use super::plan::Needs;
use super::schedule::{Light, Schedule};
use super::sensor::{FixedPattern, Sensor, bloom};
use super::timetable::Timetable;
use super::{Decision, Options, Plan, Term, glare};
use crate::pattern_image::PatternImage;
use crate::scene::{Moment, World, Worlds};
use crate::shot::Shot;
use crate::transport::{Aperture, Input, Rays, geometry, ideal_points};
use glam::DVec2;
use keys::Keys;
use news::News;
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::manifest::MAX_FRAMES;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::Frame;
use rayon::prelude::*;
use std::sync::Arc;

/// Number of pixels that pass through exposure and sensor together. They fit in the L1 cache and are
/// a whole number of blocks of random numbers.
const CHUNK: usize = 2048;

/// Renders the frames of one camera in front of one scene.
pub struct Renderer {
    profile: Profile,
    /// Scene from which the worlds are built.
    scene: Scene,
    worlds: Worlds,
    optics: Optics,
    /// Moment to which `worlds` has been moved, and the device time in nanoseconds if geometry may
    /// be interpolated at that moment; `None` at power-on.
    moment: Option<(Moment, Option<f64>)>,
    /// Geometry at key instants of a moving scene.
    keys: Keys,
    plan: Plan,
    /// Terms that are included (`true`) or excluded (`false`) regardless of whether the scene needs
    /// them.
    forced: Vec<(Term, bool)>,
    options: Options,
    seed: u64,
    /// Ideal image points of the pixels, if the lens has distortion.
    rays: Option<Vec<DVec2>>,
    buffer: GeometryBuffer,
    /// Whether the buffer is valid for the current scene state and plan.
    geometry_done: bool,
    /// Sensitivities and offsets of the pixels, if the plan includes them.
    fixed: Option<FixedPattern>,
    /// Tables of the patterns seen so far.
    tables: Vec<(Arc<PatternImage>, Arc<Table>)>,
    /// Revision of scene and plan; it increases whenever one of them changes.
    revision: u64,
    /// The GPU passes; `None` if no GPU is used.
    gpu: Option<Box<Passes>>,
    news: News,
}

/// Maximum memory for pattern tables in bytes: hundreds of fringes, or a dozen images. The oldest
/// tables are evicted first.
const TABLE_BYTES: usize = 256 << 20;

impl Renderer {
    /// Prepares a scene for rendering with one ray per pixel. `seed` is the seed of the sensor
    /// noise.
    ///
    /// # Errors
    /// Returns an error if a mesh cannot be read or if there are too many triangles.
    pub fn new(profile: &Profile, scene: &Scene, seed: u64) -> Result<Self> {
        Self::with_options(profile, scene, seed, Options::default())
    }

    /// Same as [`Self::new`] with the given options.
    ///
    /// # Errors
    /// Returns an error if [`Self::new`] or [`Options::checked`] fails.
    pub fn with_options(
        profile: &Profile,
        scene: &Scene,
        seed: u64,
        options: Options,
    ) -> Result<Self> {
        Self::with_stop(profile, scene, seed, options, Stop::default())
    }

    /// Same as [`Self::with_options`], but another thread can end the preparation early with the
    /// request `stop`. [`Self::stop`] later returns the same request.
    ///
    /// # Errors
    /// Returns [`Error::Interrupted`] soon after a stop is requested, and the errors of
    /// [`Self::with_options`]. The file, the material and the hierarchy of one mesh are each
    /// completed before `stop` is checked.
    pub fn with_stop(
        profile: &Profile,
        scene: &Scene,
        seed: u64,
        options: Options,
        stop: Stop,
    ) -> Result<Self> {
        let options = options.checked()?;
        stop.check()?;
        let asked = stop.times();
        let optics = Optics::new(profile, scene);
        let world = World::with_stop(scene, &optics.skins, &stop)?;
        let plan = Plan::new(&Needs {
            profile,
            optics: &optics,
            world: &world,
        });
        let rays = plan
            .has(Term::CameraDistortion)
            .then(|| ideal_points(&optics));
        let fixed = fixed_pattern(&plan, profile);
        let camera = &profile.camera;
        let pixels = u64::from(camera.width_px) * u64::from(camera.height_px);
        let (gpu, mut news) = news::open(
            options.backend,
            || gpu::fits(&world, &optics),
            (pixels, u64::from(options.samples)),
        )?;
        news.add(world.notes());
        let mut renderer = Self {
            profile: profile.clone(),
            scene: scene.clone(),
            worlds: Worlds::new(world),
            optics,
            moment: None,
            keys: Keys::default(),
            plan,
            forced: Vec::new(),
            options,
            seed,
            rays,
            buffer: GeometryBuffer::default(),
            geometry_done: false,
            fixed,
            tables: Vec::new(),
            revision: 0,
            gpu,
            news,
        };
        renderer.worlds.stop = stop.clone();
        renderer.choose_gathering();
        match stop.times() == asked {
            true => Ok(renderer),
            false => Err(Error::Interrupted),
        }
    }

    /// Returns the terms that are computed for the patterns seen so far.
    pub fn plan(&self) -> Plan {
        self.plan
    }

    /// Returns the plan's decision on every term, with the reason.
    pub fn decisions(&self) -> Vec<Decision> {
        self.plan.decisions(&Needs {
            profile: &self.profile,
            optics: &self.optics,
            world: self.worlds.any(),
        })
    }

    /// Includes or excludes a term from now on, regardless of whether the scene needs it. Including
    /// a term that the scene does not need changes no byte of a frame, except that the geometry of a
    /// moving scene is not interpolated with depth of field, and key instants are closer with albedo
    /// maps.
    pub fn force(&mut self, term: Term, included: bool) {
        self.forced.retain(|(forced, _)| *forced != term);
        self.forced.push((term, included));
        let mut plan = self.plan;
        plan.set(term, included);
        self.go_by(plan);
    }

    /// Switches to another plan.
    fn go_by(&mut self, plan: Plan) {
        self.plan = plan;
        // Without a table of rays, the lens model distorts the rays, so its coefficients are cleared
        // when the term is off.
        self.optics.camera.lens.distortion = match plan.has(Term::CameraDistortion) {
            true => self.profile.camera.distortion,
            false => [0.0; 5],
        };
        let table = || ideal_points(&self.optics);
        self.rays = self.plan.has(Term::CameraDistortion).then(table);
        self.fixed = fixed_pattern(&self.plan, &self.profile);
        self.outdate();
        self.tables.clear();
    }

    /// Returns the request with which another thread ends rendering early. Frames and truths that
    /// are rendered while the request stands are invalid.
    pub fn stop(&self) -> Stop {
        self.worlds.stop.clone()
    }

    /// Replaces the stop request by a new one; copies of the old request no longer affect this
    /// renderer.
    pub fn renew_stop(&mut self) {
        self.worlds.stop = Stop::default();
    }

    /// Returns the number of triangles in the scene.
    pub fn triangle_count(&self) -> usize {
        self.worlds.any().triangle_count()
    }

    /// Returns the number of pixels in a frame.
    pub fn pixel_count(&self) -> usize {
        let camera = &self.profile.camera;
        camera.width_px as usize * camera.height_px as usize
    }

    /// Adds the terms that patterns need to the plan, so that one geometry pass serves them all.
    pub fn expect_pattern_images<'a>(
        &mut self,
        pattern_images: impl IntoIterator<Item = &'a PatternImage>,
    ) {
        for pattern_image in pattern_images {
            if self.plan.include(pattern_image) {
                self.outdate();
            }
        }
    }

    /// Runs the geometry pass unless its result is up to date; a moving scene is traced at the
    /// current instant. Returns whether the pass ran.
    pub fn prepare(&mut self) -> bool {
        if self.geometry_done {
            return false;
        }
        let asked = self.worlds.stop.times();
        let mut buffer = std::mem::take(&mut self.buffer);
        match self.moment {
            Some((_, Some(time_ns))) if self.interpolates() => {
                self.trace_between(time_ns, &mut buffer);
            }
            _ => self.trace(&mut buffer),
        }
        self.buffer = buffer;
        let stop = &self.worlds.stop;
        self.geometry_done = !stop.is_asked() && stop.times() == asked;
        true
    }

    /// Runs the geometry pass into a buffer.
    fn trace(&self, buffer: &mut GeometryBuffer) {
        geometry::run(&self.geometry_input(&self.pixel_rays()), buffer);
    }

    fn geometry_input<'a>(&'a self, rays: &'a Rays<'a>) -> Input<'a> {
        Input {
            worlds: &self.worlds,
            optics: &self.optics,
            rays,
            plan: &self.plan,
            options: self.options,
            aperture: Aperture::new(&self.profile.camera),
            occluders: None,
        }
    }

    /// Returns the rays of the camera's pixels.
    fn pixel_rays(&self) -> Rays<'_> {
        Rays {
            optics: &self.optics,
            table: self.rays.as_deref(),
            width: self.profile.camera.width_px as usize,
        }
    }

    /// Discards the result of the geometry pass, for example after the scene has moved.
    pub fn invalidate(&mut self) {
        self.outdate();
    }

    /// Marks scene or plan as changed.
    fn outdate(&mut self) {
        self.keys = Keys::default();
        self.outdate_moment();
    }

    /// Marks the current instant of the scene as changed.
    fn outdate_moment(&mut self) {
        self.geometry_done = false;
        self.revision += 1;
    }

    /// Renders the frame of one exposure on the CPU.
    fn expose_here(&mut self, shot: &Shot) -> Frame {
        let light = self.light(shot);
        let sensor = self.sensor(shot);
        let bytes = self.profile.camera.sensor.native_format().bytes_per_pixel();
        let mut data = vec![0; self.buffer.x.len() * bytes];
        self.pixels(
            light,
            &sensor,
            |first, electrons, out| sensor.read(first, electrons, out),
            &mut data,
            bytes,
        );
        self.frame(shot, data)
    }

    fn frame(&self, shot: &Shot, data: Vec<u8>) -> Frame {
        let camera = &self.profile.camera;
        Frame {
            id: shot.id,
            pattern_index: shot.pattern_index,
            width: camera.width_px,
            height: camera.height_px,
            format: camera.sensor.native_format(),
            exposure_start_ns: shot.start_ns,
            exposure_end_ns: shot.end_ns(),
            data,
        }
    }

    /// Returns the signal of each pixel in digital numbers, without noise and rounding.
    pub fn expected_dn(&mut self, shot: &Shot) -> Vec<f32> {
        let light = self.light(shot);
        self.expected(shot, light)
    }

    fn expected(&self, shot: &Shot, light: Light) -> Vec<f32> {
        let sensor = self.sensor(shot);
        let mut out = vec![0.0f32; self.buffer.x.len()];
        self.pixels(
            light,
            &sensor,
            |first, electrons, out| sensor.expect(first, electrons, out),
            &mut out,
            1,
        );
        out
    }

    /// Prepares geometry and pattern tables for shots before they are exposed.
    pub fn make_ready(&mut self, shots: &[Shot]) {
        for shot in shots {
            self.schedule(shot);
        }
    }

    /// Prepares geometry and pattern tables for a shot.
    fn schedule(&mut self, shot: &Shot) -> Schedule {
        let (when, tables) = self.pattern_images(shot);
        self.prepare();
        Schedule::new(when, tables, &self.plan, &self.buffer)
    }

    /// Returns the timetable of a shot's patterns and the tables of these patterns; adds the terms
    /// that the patterns need to the plan.
    fn pattern_images(&mut self, shot: &Shot) -> (Timetable, Vec<Arc<Table>>) {
        let camera = &self.profile.camera;
        let size = [camera.width_px, camera.height_px].map(|side| side as usize);
        let when = Timetable::new(shot, &self.plan, self.optics.flicker, size);
        let pattern_images: Vec<_> = when
            .places
            .iter()
            .map(|&place| match place {
                0 => &shot.pattern_image,
                _ => &shot.then[place - 1].pattern_image,
            })
            .collect();
        self.expect_pattern_images(
            pattern_images
                .iter()
                .filter_map(|pattern_image| pattern_image.as_deref()),
        );
        let tables = pattern_images
            .into_iter()
            .map(|pattern_image| self.table(pattern_image.as_ref()));
        let tables = tables.collect();
        (when, tables)
    }

    fn sensor(&self, shot: &Shot) -> Sensor<'_> {
        Sensor::new(
            &self.profile.camera.sensor,
            &self.plan,
            (shot.gain_db, shot.exposure_ns as f64 * 1e-9),
            (self.seed, shot.noise_id),
            self.fixed.as_ref(),
        )
    }

    /// Exposes chunks of pixels in parallel and reads each chunk out into `out`, which has
    /// `per_pixel` elements for each pixel. A term that moves light or charge between pixels needs
    /// the whole frame between its stages, and so does light that is summed over instants. Without
    /// either, a chunk passes through all stages while it is in the cache.
    fn pixels<T: Send>(
        &self,
        light: Light,
        sensor: &Sensor<'_>,
        read: impl Fn(usize, &mut [f32], &mut [T]) + Sync,
        out: &mut [T],
        per_pixel: usize,
    ) {
        let gather = |first, electrons: &mut [f32], out: &mut [T]| {
            sensor.gather(first, electrons);
            read(first, electrons, out);
        };
        let fused = !self.plan.has(Term::Glare) && !self.plan.has(Term::Blooming);
        let mut frame = match light {
            Light::Scheduled(schedule) if fused => {
                self.electrons(&schedule, gather, out, per_pixel);
                return;
            }
            Light::Scheduled(schedule) => {
                let mut frame = vec![0.0; self.buffer.x.len()];
                let keep =
                    |_, electrons: &mut [f32], out: &mut [f32]| out.copy_from_slice(electrons);
                self.electrons(&schedule, keep, &mut frame, 1);
                frame
            }
            Light::Summed(frame) => frame,
        };
        let camera = &self.profile.camera;
        if self.plan.has(Term::Glare)
            && let Some(glare) = &camera.glare
        {
            glare::spread(&mut frame, self.buffer.width, glare, camera.pixel_aspect);
        }
        frame
            .par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(i, electrons)| sensor.gather(i * CHUNK, electrons));
        if self.plan.has(Term::Blooming) {
            let share = camera.sensor.blooming_percent / 100.0;
            bloom::spill(
                &mut frame,
                self.buffer.width,
                sensor.full_well_e(),
                share as f32,
            );
        }
        frame
            .par_chunks_mut(CHUNK)
            .zip(out.par_chunks_mut(CHUNK * per_pixel))
            .enumerate()
            .for_each(|(i, (electrons, out))| read(i * CHUNK, electrons, out));
    }

    /// Runs the exposure pass over chunks of pixels in parallel. Passes the electrons of each chunk
    /// on, together with the chunk's part of `out`, which has `per_pixel` elements for each pixel.
    fn electrons<T: Send>(
        &self,
        schedule: &Schedule,
        then: impl Fn(usize, &mut [f32], &mut [T]) + Sync,
        out: &mut [T],
        per_pixel: usize,
    ) {
        out.par_chunks_mut(CHUNK * per_pixel)
            .enumerate()
            .for_each_init(
                || vec![0.0; CHUNK],
                |electrons, (i, out)| {
                    if self.worlds.stop.is_asked() {
                        return;
                    }
                    let first = i * CHUNK;
                    let electrons = &mut electrons[..out.len() / per_pixel];
                    schedule.run(&self.buffer, first, electrons);
                    then(first, electrons, out);
                },
            );
    }

    /// Returns the prepared table of a pattern, or a table without light for `None`.
    fn table(&mut self, pattern_image: Option<&Arc<PatternImage>>) -> Arc<Table> {
        let Some(pattern_image) = pattern_image else {
            return Arc::new(Table::Uniform(0.0));
        };
        if let Some((_, table)) = self
            .tables
            .iter()
            .find(|(s, _)| Arc::ptr_eq(s, pattern_image))
        {
            return table.clone();
        }
        let table = Arc::new(Table::new(
            pattern_image,
            &self.profile.projector,
            &self.plan,
        ));
        self.tables.push((pattern_image.clone(), table.clone()));
        let mut bytes: usize = self.tables.iter().map(|(_, table)| table.bytes()).sum();
        while bytes > TABLE_BYTES || self.tables.len() > MAX_FRAMES {
            bytes -= self.tables.remove(0).1.bytes();
        }
        table
    }
}

/// Returns the fixed pattern of the profile's sensor, if the plan includes it.
fn fixed_pattern(plan: &Plan, profile: &Profile) -> Option<FixedPattern> {
    let camera = &profile.camera;
    let pixels = camera.width_px as usize * camera.height_px as usize;
    plan.has(Term::FixedPattern)
        .then(|| FixedPattern::new(&camera.sensor, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With the distortion term disabled, a lens gives exactly the image of a lens without
    /// distortion; with the term enabled again, the lens distorts as before.
    #[test]
    fn disabled_distortion_term_gives_image_of_straight_lens() {
        let straight = Profile::load("webcam-grey").unwrap();
        let mut bent = straight.clone();
        bent.camera.distortion = [-0.2, 0.05, 1e-3, -2e-3, 0.0];
        let scene = Scene::load("sphere").unwrap();
        let row = (0..854).map(|x| (x % 16 * 16) as u16).collect();
        let shot = Shot {
            pattern_image: Some(Arc::new(PatternImage::Row(phasmid_pattern::Axis::X, row))),
            light: 1.0,
            exposure_ns: 8_000_000,
            ..Shot::default()
        };
        let mut wanted = Renderer::new(&straight, &scene, 1).unwrap();
        let mut renderer = Renderer::new(&bent, &scene, 1).unwrap();
        let own = renderer.expose(&shot);
        renderer.force(Term::CameraDistortion, false);
        assert_eq!(renderer.expose(&shot), wanted.expose(&shot));
        let decisions = renderer.decisions();
        let said = decisions.iter().find(|d| d.term == Term::CameraDistortion);
        assert_eq!(said.map(|d| d.why), Some("left out on request"));
        renderer.force(Term::CameraDistortion, true);
        assert_eq!(renderer.expose(&shot), own);
        assert_ne!(own, wanted.expose(&shot));
    }

    #[test]
    fn preparation_ends_when_another_thread_asks() {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::load("torso").unwrap();
        let stop = Stop::default();
        let prepare = || {
            Renderer::with_stop(&profile, &scene, 1, Options::default(), stop.clone())
                .map(|renderer| renderer.stop())
        };
        std::thread::scope(|threads| {
            threads.spawn(|| stop.ask());
            let why = loop {
                if let Err(why) = prepare() {
                    break why;
                }
            };
            assert!(matches!(why, Error::Interrupted));
        });
        let skins = &Optics::new(&profile, &scene).skins;
        let built = World::with_stop(&scene, skins, &stop);
        assert!(matches!(built, Err(Error::Interrupted)));
        stop.reset();
        let own = prepare().unwrap();
        stop.ask();
        assert!(own.is_asked(), "the renderer keeps the request");
    }

    #[test]
    fn images_without_end_do_not_fill_the_memory() {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::load("plane").unwrap();
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let (width, height) = (profile.projector.width_px, profile.projector.height_px);
        let one = (width as usize + 1) * (height as usize + 1) * size_of::<f64>();
        for level in 0..(TABLE_BYTES / one + 5) as u16 {
            let pattern_image = PatternImage::Image {
                width,
                height,
                levels: vec![level; (width * height) as usize],
            };
            let shot = Shot {
                id: 0,
                noise_id: 0,
                pattern_index: None,
                pattern_image: Some(Arc::new(pattern_image)),
                light: 1.0,
                start_ns: 0,
                exposure_ns: 1000,
                ..Shot::default()
            };
            renderer.table(shot.pattern_image.as_ref());
            let newest = renderer
                .tables
                .last()
                .map(|(pattern_image, _)| pattern_image.clone());
            assert!(shot.pattern_image == newest, "the table in use stays");
        }
        let bytes: usize = renderer.tables.iter().map(|(_, t)| t.bytes()).sum();
        assert!(
            bytes <= TABLE_BYTES && bytes > TABLE_BYTES - 2 * one,
            "{bytes}"
        );
    }
}
