//! `phasmid bench`: frames a second on this machine's processor and GPU, of a scene that stands still
//! and with the geometry pass in every frame, and what each pass takes.

mod measure;
mod table;

use super::backend::Choice;
use crate::cli::step;
use measure::Run;
use phasmid_core::error::Result;
use phasmid_device::Firmware;
use phasmid_profile::{Profile, Scene};
use phasmid_render::{Adapter, Backend, Options, Term};
use phasmid_render::{Renderer, shot::Shot};
use phasmid_report::stopwatch::Stopwatch;
use serde::Serialize;
use std::time::Instant;

/// Say how many frames a second the processor and the GPU of this machine render
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Device profile: a built-in name or a TOML file
    #[arg(long, default_value = "pmp-bench")]
    profile: String,
    /// What stands before it: a built-in name or a TOML file
    #[arg(long, default_value = "torso")]
    scene: String,
    /// Rays a pixel, as for `serve`: 1, 4, 16 or 64
    #[arg(long, value_name = "N", default_value_t = 1)]
    samples: u32,
    /// Frames of a round, if as many come within a second
    #[arg(long, value_name = "N", default_value_t = 1000)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    frames: u32,
    /// What is timed beside the processor
    #[arg(long, value_enum, default_value_t = Choice::Auto)]
    backend: Choice,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    profile: &'a str,
    scene: &'a str,
    /// The sequence whose frames are timed: the one that is selected at power-on.
    sequence: &'a str,
    width: u32,
    height: u32,
    triangles: usize,
    samples: u32,
    threads: usize,
    /// A memory copy of a frame's bytes, on one thread.
    copy_us: f64,
    /// The processor's figures, and the GPU's where there is one.
    runs: Vec<Run>,
    /// Why there is no GPU, where one was looked for.
    without_gpu: Option<String>,
}

/// What is timed, the same for each backend.
struct Subject<'a> {
    args: &'a Args,
    profile: &'a Profile,
    scene: &'a Scene,
    shots: Vec<Shot>,
    /// Seconds.
    copy: f64,
    watch: Stopwatch<'a>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let profile = Profile::load(&args.profile)?;
    let scene = Scene::load(&args.scene)?;
    let sequence = Firmware::new(&profile, &[])?.selected_sequence();
    let camera = &profile.camera;
    let pixels = camera.width_px as usize * camera.height_px as usize;
    let frame_bytes = pixels * camera.sensor.native_format().bytes_per_pixel();
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let watch = Stopwatch::new(&clock);
    let subject = Subject {
        args,
        profile: &profile,
        scene: &scene,
        shots: sequence.into_iter().map(|(_, shot)| shot).collect(),
        copy: watch.seconds_a_copy(frame_bytes),
        watch,
    };
    // First, as its failure may end it all.
    let (gpu, without_gpu) = subject.gpu()?;
    step("timing the processor");
    let mut cpu = subject.renderer(Backend::Cpu)?;
    let mut runs = vec![measure::cpu(&mut cpu, &subject)];
    runs.extend(gpu);
    let report = Report {
        profile: &args.profile,
        scene: &args.scene,
        sequence: &profile.sequence[0].name,
        width: camera.width_px,
        height: camera.height_px,
        triangles: cpu.triangle_count(),
        samples: args.samples,
        threads: rayon::current_num_threads(),
        copy_us: subject.copy * 1e6,
        runs,
        without_gpu,
    };
    if args.json {
        let json = serde_json::to_string_pretty(&report).expect("numbers and strings");
        println!("{json}");
    } else {
        table::print(&report);
    }
    Ok(())
}

impl Subject<'_> {
    /// A renderer of the scene, which stands still.
    fn renderer(&self, backend: Backend) -> Result<Renderer> {
        let options = Options {
            samples: self.args.samples,
            backend,
            ..Options::default()
        };
        let mut renderer = Renderer::with_options(self.profile, self.scene, 0, options)?;
        // A scene that moves has the geometry pass in every frame, which is timed of any scene.
        renderer.force(Term::Motion, false);
        renderer.expect_slides(self.shots.iter().filter_map(|shot| shot.slide.as_deref()));
        Ok(renderer)
    }

    /// The GPU's figures, or why there are none although they were asked for.
    fn gpu(&self) -> Result<(Option<Run>, Option<String>)> {
        if self.args.backend == Choice::Cpu {
            return Ok((None, None));
        }
        let mut renderer = self.renderer(self.args.backend.into())?;
        let Some(adapter) = renderer.adapter().cloned() else {
            return Ok((None, renderer.news()?));
        };
        step(&format!("timing the GPU, {}", adapter.name));
        let run = measure::gpu(&mut renderer, self, adapter);
        // Of a GPU that has failed the processor has taken the place.
        match renderer.news()? {
            Some(failed) => Ok((None, Some(failed))),
            None => Ok((Some(run), None)),
        }
    }
}
