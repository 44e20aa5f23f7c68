//! Compares noiseless frames with frames of the reference path, which traces many rays per pixel in f64
//! and looks up one held pixel of the pattern image for each ray. The difference of the fringe phases is
//! expressed as depth.

use super::closed::{Footprint, Integral};
use super::phase::{difference, mm_per_radian, phasors};
use super::rig::{self, FINE};
use super::row::times;
use crate::scanned::levels;
use crate::timing::Spread;
use glam::DVec2;
use phasmid_core::error::{Error, Result};
use phasmid_device::Device;
use phasmid_pattern::Pattern;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::Frame;
use phasmid_render::reference::Reference;
use phasmid_render::{Backend, Options};
use phasmid_render::{Renderer, shot::Shot, truth::Truth};
use phasmid_report::lab::{Context, Row, Settings, Trial};
use rayon::prelude::*;

/// Minimum modulation of a valid phase, in digital numbers of the fine converter.
pub const LEAST: f64 = 2.0 * FINE;
/// Strides of the compared pixels: on smooth surfaces, then on edges.
const EVERY: [usize; 2] = [37, 5];

/// Returns a trial of the CPU and one of the GPU.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    vec![
        Trial::new("frames/cpu", settings.seed, cpu).alone(),
        Trial::new("frames/gpu", settings.seed, gpu).alone(),
    ]
}

/// Scene, device and reference frames with which settings are compared.
struct Bench {
    profile: Profile,
    scene: Scene,
    shots: Vec<Shot>,
    reference: Reference,
    /// The pixels that are compared, and whether each is on an edge.
    pixels: Vec<(usize, bool)>,
    mm_per_radian: Vec<f64>,
    /// Reference frames.
    exact: Vec<Vec<f64>>,
    /// Number of the reference's rays per pixel.
    rays: u32,
    rounds: (usize, f64),
}

impl Bench {
    fn new(ctx: &Context<'_>) -> Result<Self> {
        let (size, rays, rounds) = match ctx.settings.quick {
            true => ((160, 112), 2048, (5, 0.3)),
            false => ((384, 224), 8192, (15, 2.0)),
        };
        let profile = rig::fine(rig::with_steps(rig::bench(size.0, size.1)?, 4));
        let scene = Scene::load("trapezoid")?;
        let mut device = Device::builder(&profile, &scene).seed(ctx.seed).build()?;
        let sequence = device.shots();
        let truth = device.renderer.truth(&sequence);
        let wanted = Truth::SEEN | Truth::LIT;
        let pixels: Vec<(usize, bool)> = (0..truth.flags.len())
            .map(|i| (i, truth.flags[i] & Truth::CREASE != 0))
            .filter(|&(i, edge)| i.is_multiple_of(EVERY[usize::from(edge)]))
            .filter(|&(i, edge)| edge || truth.flags[i] & wanted == wanted)
            .collect();
        let all = mm_per_radian(&profile.nominal_rig(), &truth);
        let fringes = sequence.into_iter();
        let fringes = fringes.filter(|(pattern, _)| matches!(pattern, Pattern::Fringe { .. }));
        let mut bench = Self {
            reference: Reference::new(&profile, &scene)?,
            shots: fringes.map(|(_, shot)| shot).collect(),
            mm_per_radian: pixels.iter().map(|&(i, _)| all[i]).collect(),
            exact: Vec::new(),
            rays,
            pixels,
            profile,
            scene,
            rounds,
        };
        bench.exact = bench.sampled(rays);
        Ok(bench)
    }

    fn px(&self, pixel: usize) -> DVec2 {
        let width = self.profile.camera.width_px as usize;
        DVec2::new((pixel % width) as f64, (pixel / width) as f64)
    }

    /// Renders reference frames with this number of rays per pixel.
    fn sampled(&self, rays: u32) -> Vec<Vec<f64>> {
        let frame = |shot: &Shot| {
            let Some(pattern_image) = &shot.pattern_image else {
                return vec![0.0; self.pixels.len()];
            };
            let seconds = shot.exposure_ns as f64 * 1e-9;
            let signal = |&(pixel, _): &(usize, bool)| {
                self.reference
                    .signal_dn(self.px(pixel), pattern_image, seconds, rays)
            };
            self.pixels.par_iter().map(signal).collect()
        };
        self.shots.iter().map(frame).collect()
    }

    /// Returns the levels of the closed form in f64, without shading; 0 on edges.
    fn closed(&self) -> Vec<Vec<f64>> {
        let place = |&(pixel, edge): &(usize, bool)| {
            (!edge).then(|| Footprint::new(&self.reference, self.px(pixel)))
        };
        let places: Vec<_> = self.pixels.par_iter().map(place).collect();
        let frame = |shot: &Shot| {
            let row = shot.pattern_image.as_deref().and_then(Integral::new);
            let mean = |place: &Option<Option<Footprint>>| match (place, &row) {
                (Some(Some(place)), Some(row)) => place.mean(row) * FINE,
                _ => 0.0,
            };
            places.iter().map(mean).collect()
        };
        self.shots.iter().map(frame).collect()
    }

    fn renderer(&self, ctx: &Context<'_>, samples: u32, backend: Backend) -> Result<Renderer> {
        let options = Options {
            samples,
            backend,
            ..Options::default()
        };
        let device = Device::builder(&self.profile, &self.scene).seed(ctx.seed);
        Ok(device.options(options).build()?.renderer)
    }

    /// Renders frames. Returns the compared pixels, and nanoseconds per pixel of a frame, including the
    /// geometry that four frames share.
    fn rendered(
        &self,
        ctx: &Context<'_>,
        renderer: &mut Renderer,
    ) -> Result<(Vec<Vec<f64>>, Spread)> {
        let scan = |renderer: &mut Renderer| -> Vec<Frame> {
            renderer.invalidate();
            let frames = self.shots.iter().map(|shot| renderer.expose(shot));
            frames.collect()
        };
        let frames = scan(renderer);
        let watch = ctx.stopwatch();
        let spread = watch.spread(self.rounds.0, self.rounds.1, || {
            std::hint::black_box(scan(renderer));
        });
        let picked = |frame: Frame| -> Result<Vec<f64>> {
            let levels = levels(frame)?;
            Ok(self
                .pixels
                .iter()
                .map(|&(pixel, _)| levels[pixel])
                .collect())
        };
        let work = (renderer.pixel_count() * self.shots.len()) as f64;
        let levels = frames.into_iter().map(picked).collect::<Result<_>>()?;
        Ok((levels, spread.times(1e9 / work)))
    }

    /// Returns a row with the errors and the time of frames, smooth surfaces and edges separately.
    fn row(&self, setting: &str, frames: &[Vec<f64>], ns: Spread) -> Row {
        let row = self.against(setting, frames, &self.exact);
        times(row.number("levels", self.levels(frames)), "ns", ns)
    }

    /// Returns a row with the differences between two sets of frames.
    fn against(&self, setting: &str, frames: &[Vec<f64>], exact: &[Vec<f64>]) -> Row {
        let (found, exact) = (phasors(frames), phasors(exact));
        let of = |edge: bool| {
            let keep = || (0..self.pixels.len()).filter(|&i| self.pixels[i].1 == edge);
            let pick = |all: &[DVec2]| keep().map(|i| all[i]).collect::<Vec<_>>();
            let mm: Vec<f64> = keep().map(|i| self.mm_per_radian[i]).collect();
            difference(&pick(&found), &pick(&exact), &mm, LEAST)
        };
        let [smooth, edges] = [false, true].map(of);
        Row::new()
            .text("group", "frames")
            .text("setting", setting)
            .number("frames", self.shots.len() as f64)
            .number("points", self.pixels.iter().filter(|p| !p.1).count() as f64)
            .number("inlier_rmse_mm", smooth.inlier_rmse_mm)
            .number("gross", edges.gross)
            .number("crease_rmse_mm", edges.inlier_rmse_mm)
    }

    /// Returns the root mean square difference on smooth surfaces, in grey levels of the bench.
    fn levels(&self, frames: &[Vec<f64>]) -> f64 {
        let (mut squares, mut count) = (0.0, 0usize);
        for (found, exact) in frames.iter().zip(&self.exact) {
            let pairs = found.iter().zip(exact).zip(&self.pixels);
            for ((found, exact), _) in pairs.filter(|(_, pixel)| !pixel.1) {
                squares += ((found - exact) / FINE).powi(2);
                count += 1;
            }
        }
        (squares / count as f64).sqrt()
    }
}

fn cpu(ctx: &Context<'_>) -> Result<Vec<Row>> {
    let bench = Bench::new(ctx)?;
    let watch = ctx.stopwatch();
    let mut rows = Vec::new();
    let mut fast = Vec::new();
    for samples in [1, 4, 16, 64] {
        let mut renderer = bench.renderer(ctx, samples, Backend::Cpu)?;
        let (frames, ns) = bench.rendered(ctx, &mut renderer)?;
        if samples == 1 {
            fast.clone_from(&frames);
        }
        let row = bench.row("closed form, f32", &frames, ns);
        rows.push(row.number("samples", f64::from(samples)));
    }
    let work = (bench.pixels.len() * bench.shots.len()) as f64;
    let frames = bench.closed();
    let ns = watch.spread(bench.rounds.0, bench.rounds.1, || {
        std::hint::black_box(bench.closed());
    });
    let row = bench.row("closed form, f64", &frames, ns.times(1e9 / work));
    rows.push(row.number("levels", f64::NAN).number("samples", 1.0));
    rows.push(bench.against("closed form, f32 against f64", &fast, &frames));
    for rays in [1, 4, 16, 64, 256] {
        let frames = bench.sampled(rays);
        let ns = watch.spread(bench.rounds.0, bench.rounds.1, || {
            std::hint::black_box(bench.sampled(rays));
        });
        let row = bench.row("sampled, f64", &frames, ns.times(1e9 / work));
        rows.push(row.number("samples", f64::from(rays)));
    }
    // A quarter of the rays shows how large the reference's own error may be.
    let rays = bench.rays / 4;
    let (frames, seconds) = watch.timed(|| bench.sampled(rays));
    let once = Spread::new(vec![seconds * 1e9 / work]);
    let row = bench.row("sampled, f64", &frames, once);
    rows.push(row.number("samples", f64::from(rays)));
    Ok(rows)
}

/// Renders with the GPU. Without an adapter, the row contains the reason.
fn gpu(ctx: &Context<'_>) -> Result<Vec<Row>> {
    let without = |why: &Error| {
        let row = Row::new().text("group", "gpu").text("backend", "gpu");
        row.text("note", &why.to_string())
    };
    let found = phasmid_render::gpu::adapters();
    if found.is_empty() {
        return Ok(vec![without(&Error::device("no Vulkan adapter"))]);
    }
    let bench = Bench::new(ctx)?;
    let mut rows = Vec::new();
    for samples in [1, 16] {
        let mut renderer = match bench.renderer(ctx, samples, Backend::Gpu) {
            Ok(renderer) => renderer,
            Err(e) => return Ok(vec![without(&e)]),
        };
        let adapter = renderer
            .adapter()
            .map(|a| format!("{} ({})", a.name, a.kind));
        let (frames, ns) = bench.rendered(ctx, &mut renderer)?;
        if let Err(e) = renderer.news() {
            return Ok(vec![without(&e)]);
        }
        let row = bench.row("closed form, f32", &frames, ns);
        let row = row
            .text("group", "gpu")
            .text("backend", "gpu")
            .text("adapter", &adapter.unwrap_or_default());
        rows.push(row.number("samples", f64::from(samples)));
    }
    Ok(rows)
}
