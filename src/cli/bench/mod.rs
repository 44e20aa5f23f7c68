//! `phasmid bench`: frame rates of this machine's CPU and GPU, for a static scene and with the
//! geometry pass in every frame, and the time of each pass.

mod measure;
mod table;

use super::backend::Choice;
use crate::cli::set::SetArgs;
use crate::cli::step;
use measure::Run;
use phasmid_core::error::Result;
use phasmid_device::{Device, Firmware};
use phasmid_profile::{Profile, Scene};
use phasmid_render::{Adapter, Backend, Options, Term};
use phasmid_render::{Renderer, shot::Shot};
use phasmid_report::stopwatch::Stopwatch;
use serde::Serialize;
use std::time::Instant;

/// Measure how many frames per second the CPU and the GPU of this machine render
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid bench --profile dlp-evm --scene plane")]
pub struct Args {
    /// Device profile: a built-in name or a TOML file
    #[arg(long, default_value = "pmp-bench")]
    profile: String,
    /// Scene in front of the device: a built-in name or a TOML file
    #[arg(long, default_value = "torso")]
    scene: String,
    #[command(flatten)]
    set: SetArgs,
    /// Rays per pixel: 1, 4, 16 or 64
    #[arg(long, value_name = "N", default_value_t = 1)]
    samples: u32,
    /// Maximum number of frames per round; a round has fewer if these take more than a second
    #[arg(long, value_name = "N", default_value_t = 1000)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    frames: u32,
    /// Which backend to time besides the CPU; cpu times the CPU alone
    #[arg(long, value_enum, default_value_t = Choice::Auto)]
    backend: Choice,
    /// Print the results as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    profile: &'a str,
    scene: &'a str,
    /// The sequence whose frames are timed: the default at power-on.
    sequence: &'a str,
    width: u32,
    height: u32,
    triangles: usize,
    samples: u32,
    threads: usize,
    /// Time of a memory copy of a frame's bytes on one thread, in microseconds.
    copy_us: f64,
    /// Results of each backend: the CPU and, if one was timed, the GPU.
    runs: Vec<Run>,
    /// Why no GPU was timed; `None` if one was timed or none was requested.
    without_gpu: Option<String>,
}

/// Inputs of the measurement, equal for every backend.
struct Subject<'a> {
    args: &'a Args,
    profile: &'a Profile,
    scene: &'a Scene,
    shots: Vec<Shot>,
    /// Time of a memory copy of a frame's bytes, in seconds.
    copy: f64,
    watch: Stopwatch<'a>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let (profile, scene) = args.set.load(&args.profile, &args.scene)?;
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
    // The GPU comes first, because its failure may end the command.
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
    /// Makes a renderer of the scene, without motion.
    fn renderer(&self, backend: Backend) -> Result<Renderer> {
        let options = Options {
            samples: self.args.samples,
            backend,
            ..Options::default()
        };
        let device = Device::builder(self.profile, self.scene);
        let mut renderer = device.options(options).build()?.renderer;
        // Motion would run the geometry pass in every frame; that case is timed for any scene.
        renderer.force(Term::Motion, false);
        Ok(renderer)
    }

    /// Returns the GPU's results, or the reason why a requested GPU was not timed.
    fn gpu(&self) -> Result<(Option<Run>, Option<String>)> {
        if self.args.backend == Choice::Cpu {
            return Ok((None, None));
        }
        let mut renderer = self.renderer(self.args.backend.into())?;
        let news = renderer.news()?;
        let Some(adapter) = renderer.adapter().cloned() else {
            return Ok((None, news));
        };
        step(&format!("timing the GPU, {}", adapter.name));
        let run = measure::gpu(&mut renderer, self, adapter);
        // If the GPU has failed, the CPU has rendered in its place.
        match renderer.news()? {
            Some(failed) => Ok((None, Some(failed))),
            None => Ok((Some(run), None)),
        }
    }
}
