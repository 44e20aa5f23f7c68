//! Rates of the passes, each beside a memory copy of the same bytes in the same run: machines
//! differ and wander, the ratio less so.

use super::cases::{NAMES, case};
use phasmid_core::error::Result;
use phasmid_device::Device;
use phasmid_profile::{Profile, Scene};
use phasmid_render::shot::Shot;
use phasmid_render::{Backend, Options, gpu::adapters};
use phasmid_report::lab::{Context, Row, Settings, Trial};
use std::hint::black_box;

/// A trial for each pass, and one for the GPU.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    let trial = |name: &'static str| {
        let key = name
            .replace(", ", "/")
            .replace(" + ", "-")
            .replace(' ', "-");
        Trial::new(format!("pass/{key}"), settings.seed, move |ctx| {
            run(ctx, name)
        })
        .alone()
    };
    let mut trials: Vec<Trial> = NAMES.into_iter().map(trial).collect();
    trials.push(Trial::new("pass/gpu", settings.seed, gpu).alone());
    trials
}

/// The bench, or in the quick form a third of each side of its field.
///
/// # Errors
/// None, as long as the built-in profile is sound.
pub(super) fn bench(settings: &Settings) -> Result<Profile> {
    let mut profile = Profile::load("pmp-bench")?;
    if settings.quick {
        let camera = &mut profile.camera;
        camera.sensor_width_mm *= 380.0 / f64::from(camera.width_px);
        (camera.width_px, camera.height_px) = (380, 160);
    }
    Ok(profile)
}

fn run(ctx: &Context<'_>, name: &str) -> Result<Vec<Row>> {
    let mut case = case(name, &bench(ctx.settings)?, &ctx.folder.files())?;
    let enough_s = if ctx.settings.quick { 0.1 } else { 1.5 };
    let bytes = case.pixels * case.bytes_per_pixel;
    let watch = ctx.stopwatch();
    let [all, copy] = watch.beside_a_copy(bytes, enough_s, &mut case.work);
    let row = Row::new()
        .text("group", "pass")
        .text("name", name)
        .number("pixels", case.pixels as f64)
        .number("frames", case.count as f64)
        .number("bytes", case.bytes_per_pixel as f64)
        .number("pass_us", all / case.count as f64 * 1e6)
        .number("copy_us", copy * 1e6);
    Ok(vec![row])
}

/// Frames of the GPU, with the geometry pass in each or without.
fn gpu(ctx: &Context<'_>) -> Result<Vec<Row>> {
    let row = || Row::new().text("group", "gpu").text("backend", "gpu");
    if adapters().is_empty() {
        return Ok(vec![row().text("note", "no Vulkan adapter")]);
    }
    let profile = bench(ctx.settings)?;
    let scene = Scene::load("torso")?;
    let options = Options {
        backend: Backend::Gpu,
        ..Options::default()
    };
    let device = Device::builder(&profile, &scene).seed(1);
    let device = match device.options(options).build() {
        Ok(device) => device,
        Err(e) => return Ok(vec![row().text("note", &e.to_string())]),
    };
    let shots: Vec<Shot> = device.shots().into_iter().map(|(_, shot)| shot).collect();
    let mut renderer = device.renderer;
    let adapter = renderer
        .adapter()
        .map(|a| format!("{} ({})", a.name, a.kind));
    let adapter = adapter.unwrap_or_default();
    let pixels = renderer.pixel_count();
    let enough_s = if ctx.settings.quick { 0.1 } else { 1.5 };
    let watch = ctx.stopwatch();
    let mut rows = Vec::new();
    for (name, moves) in [("frame, torso", false), ("geometry and frame, torso", true)] {
        let mut at = 0;
        let work = || {
            at = (at + 1) % shots.len();
            if moves {
                renderer.invalidate();
            }
            black_box(renderer.expose(&shots[at]));
        };
        let [one, copy] = watch.beside_a_copy(pixels, enough_s, work);
        rows.push(
            row()
                .text("name", name)
                .text("adapter", &adapter)
                .number("pixels", pixels as f64)
                .number("frames", 1.0)
                .number("pass_us", one * 1e6)
                .number("copy_us", copy * 1e6),
        );
    }
    // Of a GPU that has failed the processor has taken the place.
    match renderer.news() {
        Ok(_) => Ok(rows),
        Err(e) => Ok(vec![row().text("note", &e.to_string())]),
    }
}
