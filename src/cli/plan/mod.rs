//! `phasmid plan`: reports which terms of image formation a profile and a scene need, why, and what
//! each costs on this machine; and which setting reaches a wanted accuracy in the least time.

mod accuracy;
mod measure;
mod motion;

use crate::cli::options::SetArgs;
use measure::{PassCost, TermCost, costs};
use motion::Motion;
use phasmid_core::error::Result;
use phasmid_device::Device;
use phasmid_render::{IndirectLight, Options, shot::Shot};
use serde::Serialize;

/// Report which terms of image formation a device and a scene need, why, and what each costs here
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  phasmid plan --profile dlp-evm --scene plane\n  phasmid plan --profile webcam-grey --scene sphere --accuracy 0.1mm"
)]
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
    /// Instants per exposure at which a moving scene is rendered, 1 to 256
    #[arg(long, value_name = "N", default_value_t = 4)]
    time_samples: u32,
    /// Maximum error in projector pixels, 0 to 1, of geometry that is interpolated between instants
    /// of a moving scene; 0 computes the geometry at every instant
    #[arg(long, value_name = "PX", default_value_t = Options::default().motion_tolerance_px)]
    motion_tolerance: f64,
    /// Scan the scene with every setting that trades error for run time, and name the fastest one whose RMS depth error is at most this length: 0.1mm, 50um
    #[arg(long, value_name = "LENGTH", value_parser = accuracy::length_mm)]
    #[arg(conflicts_with_all = ["samples", "time_samples", "motion_tolerance"])]
    accuracy: Option<f64>,
    /// Print the plan as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    profile: &'a str,
    scene: &'a str,
    /// The sequence whose frames are timed: the default at power-on.
    sequence: &'a str,
    frames: usize,
    pixels: usize,
    triangles: usize,
    samples: u32,
    threads: usize,
    passes: Vec<PassCost>,
    terms: Vec<TermCost>,
    /// `None` if the geometry of every instant is traced.
    motion: Option<Motion>,
    /// `None` for a scene without interreflection.
    interreflection: Option<IndirectLight>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let (profile, scene) = args.set.load(&args.profile, &args.scene)?;
    if let Some(accuracy_mm) = args.accuracy {
        return accuracy::run(&profile, &scene, accuracy_mm, args.json);
    }
    let options = Options {
        samples: args.samples,
        time_samples: args.time_samples,
        motion_tolerance_px: args.motion_tolerance,
        ..Options::default()
    };
    let device = Device::builder(&profile, &scene).options(options).build()?;
    let shots: Vec<Shot> = device.shots().into_iter().map(|(_, shot)| shot).collect();
    let mut renderer = device.renderer;
    let motion = Motion::measured(&mut renderer, &shots, options.motion_tolerance_px);
    let (passes, terms) = costs(&mut renderer, &shots);
    let report = Report {
        profile: &args.profile,
        scene: &args.scene,
        sequence: &profile.sequence[0].name,
        frames: shots.len(),
        pixels: renderer.pixel_count(),
        triangles: renderer.triangle_count(),
        samples: args.samples,
        threads: rayon::current_num_threads(),
        passes,
        terms,
        motion,
        interreflection: renderer.indirect_light(),
    };
    if args.json {
        let json = serde_json::to_string_pretty(&report).expect("numbers and strings");
        println!("{json}");
    } else {
        table(&report);
    }
    Ok(())
}

fn table(report: &Report<'_>) {
    println!(
        "{} looking at {}: {} pixels, {} triangles, {} ({} frames), {} samples a pixel, {} threads",
        report.profile,
        report.scene,
        report.pixels,
        report.triangles,
        report.sequence,
        report.frames,
        report.samples,
        report.threads
    );
    println!("\n{:<24}{:>8}  runs", "pass", "ns/px");
    for pass in &report.passes {
        println!("{:<24}{:>8.2}  {}", pass.pass, pass.ns_per_pixel, pass.runs);
    }
    println!("\n{:<24}{:>8}  {:<5}why", "term", "ns/px", "");
    for term in &report.terms {
        let decision = &term.decision;
        println!(
            "{:<24}{:>8.2}  {:<5}{}",
            decision.term.to_string(),
            term.ns_per_pixel,
            if decision.included { "in" } else { "out" },
            decision.why
        );
    }
    println!(
        "\nns/px: with all threads, the fastest of several rounds; of a term, the time that it adds \
         or would add."
    );
    if let Some(motion) = &report.motion {
        println!("\n{motion}");
    }
    if let Some(light) = report.interreflection {
        let bound = match light.bound_percent {
            Some(bound) => format!("bound {bound} %"),
            None => "settings from the scene".to_owned(),
        };
        println!(
            "\ninterreflection: {} rays at every {}: error {:.2} % of the light in 99 % of the lit \
             pixels ({bound}); further bounces, which are not rendered, would add up to {:.2} % in half of \
             them and {:.1} % in 95 %",
            light.samples,
            match light.step_px {
                1 => "pixel".to_owned(),
                2 => "second pixel".to_owned(),
                step => format!("{step} pixels"),
            },
            light.error_percent,
            light.further_percent,
            light.most_further_percent
        );
    }
}
