//! One camera before one scene: runs the passes that a shot needs.

use super::buffer::GeometryBuffer;
use super::exposure::Table;
use super::geometry::{self, Rays};
use super::sensor::Sensor;
use super::shade::Optics;
use super::term::Needs;
use super::world::World;
use super::{Decision, Plan, Term, exposure, flicker};
use crate::emulator::{Shot, Slide, Truth, truth};
use crate::error::Result;
use crate::pattern::manifest::MAX_FRAMES;
use crate::pattern::{Pattern, finest_fringe};
use crate::profile::{Profile, Scene};
use crate::protocol::Frame;
use glam::DVec2;
use rayon::prelude::*;
use std::sync::Arc;

/// Pixels that go through exposure and sensor together: they stay in the first-level cache, and
/// are whole blocks of random numbers.
const CHUNK: usize = 2048;

/// Renders the frames of one camera in front of one scene.
pub struct Renderer {
    profile: Profile,
    world: World,
    optics: Optics,
    plan: Plan,
    seed: u64,
    /// Ideal image points of the pixels, where the lens is distorted.
    rays: Option<Vec<DVec2>>,
    buffer: GeometryBuffer,
    /// Whether the buffer holds this state of the scene under this plan.
    geometry_done: bool,
    /// Tables of the slides seen so far.
    tables: Vec<(Arc<Slide>, Arc<Table>)>,
}

/// Memory for tables of slides: hundreds of fringes, or a dozen pictures. The oldest go first.
const TABLE_BYTES: usize = 256 << 20;

impl Renderer {
    /// Prepares a scene. `seed` keys the sensor's noise.
    ///
    /// # Errors
    /// Mesh files that cannot be read, or too many triangles.
    pub fn new(profile: &Profile, scene: &Scene, seed: u64) -> Result<Self> {
        let world = World::new(scene)?;
        let optics = Optics::new(profile, scene);
        let plan = Plan::new(&Needs {
            profile,
            optics: &optics,
            world: &world,
        });
        let rays = plan
            .has(Term::CameraDistortion)
            .then(|| ideal_points(&optics));
        Ok(Self {
            profile: profile.clone(),
            world,
            optics,
            plan,
            seed,
            rays,
            buffer: GeometryBuffer::default(),
            geometry_done: false,
            tables: Vec::new(),
        })
    }

    /// Which terms are computed for the slides seen so far.
    pub fn plan(&self) -> Plan {
        self.plan
    }

    /// What the plan says of every term, and why.
    pub fn decisions(&self) -> Vec<Decision> {
        self.plan.decisions(&Needs {
            profile: &self.profile,
            optics: &self.optics,
            world: &self.world,
        })
    }

    /// Computes a term, or leaves it out, whatever the scene needs: for tests and for costs. A
    /// term that is not needed changes no byte.
    pub fn force(&mut self, term: Term, included: bool) {
        self.plan.set(term, included);
        let table = || ideal_points(&self.optics);
        self.rays = self.plan.has(Term::CameraDistortion).then(table);
        self.geometry_done = false;
    }

    /// Triangles in the scene.
    pub fn triangle_count(&self) -> usize {
        self.world.triangle_count()
    }

    /// Adds what slides need to the plan, so that one geometry pass serves them all.
    pub fn expect_slides<'a>(&mut self, slides: impl IntoIterator<Item = &'a Slide>) {
        for slide in slides {
            if self.plan.include(slide) {
                self.geometry_done = false;
            }
        }
    }

    /// Runs the geometry pass if its result is not at hand; tells whether it ran.
    pub fn prepare(&mut self) -> bool {
        if self.geometry_done {
            return false;
        }
        let rays = Rays {
            optics: &self.optics,
            table: self.rays.as_deref(),
            width: self.profile.camera.width_px as usize,
        };
        geometry::run(
            &self.world,
            &self.optics,
            &rays,
            &self.plan,
            &mut self.buffer,
        );
        self.geometry_done = true;
        true
    }

    /// Forgets the geometry pass's result, as a scene that has moved does.
    pub fn invalidate(&mut self) {
        self.geometry_done = false;
    }

    /// The frame of one exposure. The same seed, noise id and settings give the same bytes on any
    /// number of threads.
    pub fn expose(&mut self, shot: &Shot) -> Frame {
        if let Some(slide) = &shot.slide {
            self.expect_slides([slide.as_ref()]);
        }
        self.prepare();
        let table = self.table(shot);
        let noise = self
            .plan
            .has(Term::Noise)
            .then_some((self.seed, shot.noise_id));
        let camera = &self.profile.camera;
        let sensor = Sensor::new(&camera.sensor, shot.gain_db, noise);
        let bytes = camera.sensor.native_format().bytes_per_pixel();
        let mut data = vec![0; self.buffer.x.len() * bytes];
        self.electrons(
            shot,
            &table,
            |first, electrons, out| {
                sensor.run(first, electrons, out);
            },
            &mut data,
            bytes,
        );
        Frame {
            id: shot.id,
            pattern_index: shot.pattern_index,
            width: camera.width_px,
            height: camera.height_px,
            format: camera.sensor.native_format(),
            exposure_start_ns: shot.start_ns,
            exposure_end_ns: shot.start_ns + shot.exposure_ns,
            data,
        }
    }

    /// Noise-free signal in digital numbers, before rounding: what the sensor would mean to say.
    pub fn expected_dn(&mut self, shot: &Shot) -> Vec<f32> {
        if let Some(slide) = &shot.slide {
            self.expect_slides([slide.as_ref()]);
        }
        self.prepare();
        let table = self.table(shot);
        let camera = &self.profile.camera;
        let sensor = Sensor::new(&camera.sensor, shot.gain_db, None);
        let mut out = vec![0.0f32; self.buffer.x.len()];
        self.electrons(
            shot,
            &table,
            |_, electrons, out| {
                for (dn, &e) in out.iter_mut().zip(electrons.iter()) {
                    *dn = sensor.signal_dn(e);
                }
            },
            &mut out,
            1,
        );
        out
    }

    /// Runs the exposure pass over chunks of pixels in parallel and hands each chunk's electrons
    /// on, with the `per_pixel` elements of `out` that belong to each pixel.
    fn electrons<T: Send>(
        &self,
        shot: &Shot,
        table: &Table,
        then: impl Fn(usize, &mut [f32], &mut [T]) + Sync,
        out: &mut [T],
        per_pixel: usize,
    ) {
        let seconds = (shot.exposure_ns as f64 * 1e-9) as f32;
        let light = if shot.slide.is_some() {
            shot.light as f32
        } else {
            0.0
        };
        let swing = self.plan.has(Term::Flicker).then(|| {
            let flicker = self.optics.flicker;
            flicker.map_or(0.0, |f| f.swing(shot.start_ns, shot.exposure_ns)) as f32 * seconds
        });
        let map = &self.buffer;
        out.par_chunks_mut(CHUNK * per_pixel)
            .enumerate()
            .for_each_init(
                || vec![0.0; CHUNK],
                |electrons, (i, out)| {
                    let first = i * CHUNK;
                    let electrons = &mut electrons[..out.len() / per_pixel];
                    exposure::run(map, table, seconds, light, first, electrons);
                    if let Some(swing) = swing {
                        flicker::add(map, swing, first, electrons);
                    }
                    let from = map.mixed.partition_point(|m| (m.pixel as usize) < first);
                    let end = first + electrons.len();
                    for pixel in &map.mixed[from..] {
                        if pixel.pixel as usize >= end {
                            break;
                        }
                        electrons[pixel.pixel as usize - first] =
                            exposure::mixed(pixel, table, seconds, light)
                                + swing.map_or(0.0, |swing| swing * pixel.flickering);
                    }
                    then(first, electrons, out);
                },
            );
    }

    /// The prepared table of a shot's slide.
    fn table(&mut self, shot: &Shot) -> Arc<Table> {
        let Some(slide) = &shot.slide else {
            return Arc::new(Table::Uniform(0.0));
        };
        if let Some((_, table)) = self.tables.iter().find(|(s, _)| Arc::ptr_eq(s, slide)) {
            return table.clone();
        }
        let table = Arc::new(Table::new(slide, self.profile.projector.bits));
        self.tables.push((slide.clone(), table.clone()));
        let mut bytes: usize = self.tables.iter().map(|(_, table)| table.bytes()).sum();
        while bytes > TABLE_BYTES || self.tables.len() > MAX_FRAMES {
            bytes -= self.tables.remove(0).1.bytes();
        }
        table
    }

    /// The truth behind the frames of a sequence: geometry, and the mean and modulation that its
    /// finest fringes have before noise and rounding.
    pub fn truth(&mut self, sequence: &[(Pattern, Shot)]) -> Truth {
        self.expect_slides(sequence.iter().filter_map(|(_, s)| s.slide.as_deref()));
        self.prepare();
        let fringes = finest_fringes(sequence);
        let signals: Vec<_> = fringes
            .iter()
            .map(|(_, shot)| self.expected_dn(shot))
            .collect();
        let phases: Vec<_> = fringes.iter().map(|(phase, _)| *phase).collect();
        let map = &self.buffer;
        let (mean_dn, modulation_dn) = truth::harmonic(&phases, &signals, map.x.len());
        Truth {
            width: map.width as u32,
            height: map.height as u32,
            depth_mm: map.depth.clone(),
            projector_x: map.x.clone(),
            projector_y: map.y.clone(),
            flags: map.flags.clone(),
            mean_dn,
            modulation_dn,
        }
    }
}

/// Phases and shots of the finest fringes.
fn finest_fringes(sequence: &[(Pattern, Shot)]) -> Vec<(f64, &Shot)> {
    let finest = finest_fringe(sequence.iter().map(|(pattern, _)| pattern));
    sequence
        .iter()
        .filter_map(|(pattern, shot)| match *pattern {
            Pattern::Fringe {
                axis,
                period_px,
                phase_rad,
            } if finest == Some((axis, period_px)) => Some((phase_rad, shot)),
            _ => None,
        })
        .collect()
}

fn ideal_points(optics: &Optics) -> Vec<DVec2> {
    let lens = optics.camera.lens;
    (0..lens.height_px)
        .into_par_iter()
        .flat_map_iter(|v| {
            (0..lens.width_px)
                .map(move |u| lens.ray(DVec2::new(f64::from(u), f64::from(v))).truncate())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_without_end_do_not_fill_the_memory() {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::load("plane").unwrap();
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let (width, height) = (profile.projector.width_px, profile.projector.height_px);
        let one = (width as usize + 1) * (height as usize + 1) * size_of::<f64>();
        for level in 0..(TABLE_BYTES / one + 5) as u16 {
            let slide = Slide::Picture {
                width,
                height,
                levels: vec![level; (width * height) as usize],
            };
            let shot = Shot {
                id: 0,
                noise_id: 0,
                pattern_index: None,
                slide: Some(Arc::new(slide)),
                light: 1.0,
                start_ns: 0,
                exposure_ns: 1000,
                gain_db: 0.0,
            };
            renderer.table(&shot);
            let newest = renderer.tables.last().map(|(slide, _)| slide.clone());
            assert!(shot.slide == newest, "the table in use stays");
        }
        let bytes: usize = renderer.tables.iter().map(|(_, t)| t.bytes()).sum();
        assert!(
            bytes <= TABLE_BYTES && bytes > TABLE_BYTES - 2 * one,
            "{bytes}"
        );
    }
}
