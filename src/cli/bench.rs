//! `phasmid bench`: measures frame rates of CPU and GPU, with a static scene and with the geometry
//! pass in every frame, the time of each pass and of decoding, and the speed of the links.

use super::options::{BackendArg, SetArgs};
use super::output::step;
use phasmid_core::error::Result;
use phasmid_decode::{Decoded, Known, Options as DecodeOptions, check_sequence};
use phasmid_device::{Device, Firmware};
use phasmid_profile::{Profile, Scene};
use phasmid_render::{Adapter, Backend, Options, Pass, PassTime, Term};
use phasmid_render::{Renderer, shot::Shot};
use phasmid_report::stopwatch::{ROUND_S, Stopwatch};
use phasmid_study::links::{self, LinkSpeeds};
use phasmid_study::scanned::Stage;
use phasmid_study::timing::Timing;
use serde::Serialize;
use std::collections::VecDeque;
use std::hint::black_box;
use std::time::Instant;

/// Maximum number of timed rounds of decoding. No further round begins after [`ROUND_S`] seconds.
const ROUNDS: usize = 20;
/// Maximum number of frames in which a GPU's passes are timed. Timing also ends after [`ROUND_S`]
/// seconds.
const TIMED: usize = 20;

/// Measure how many frames per second this machine renders, decodes and sends over each link
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  phasmid bench --profile dlp-evm --scene plane\n  phasmid bench --links"
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
    /// Maximum number of frames per round; a round has fewer if this many would take more than a
    /// second
    #[arg(long, value_name = "N", default_value_t = 1000)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    frames: u32,
    /// Which backend to time besides the CPU; cpu times the CPU alone
    #[arg(long, value_enum, default_value_t = BackendArg::Auto)]
    backend: BackendArg,
    /// Measure the links instead: latency from trigger to frame and frames per second over each link, with the device pmp-bench
    #[arg(long, conflicts_with_all = ["profile", "scene", "set", "samples", "backend"])]
    links: bool,
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
    /// Times of decoding a scan of the sequence on the CPU, per frame of the sequence.
    decoding: Vec<PassRow>,
    /// Why decoding was not timed.
    without_decoding: Option<String>,
}

/// Results of one backend.
#[derive(Debug, Serialize)]
struct Run {
    backend: &'static str,
    /// Name, driver and kind of the GPU; `None` for the CPU.
    adapter: Option<Adapter>,
    /// Frame rate of a static scene.
    still: Rate,
    /// Frame rate with the geometry pass in every frame.
    moving: Rate,
    /// Times of the passes, with the geometry pass in every frame. On the CPU, these are wall-clock
    /// times. On a GPU, they come from the GPU's timestamps; empty if the adapter has no
    /// timestamps.
    passes: Vec<PassRow>,
}

/// A frame rate.
#[derive(Debug, Serialize)]
struct Rate {
    frames_per_s: f64,
    /// Time per frame divided by the time of a memory copy of the frame's bytes.
    over_copy: f64,
}

/// Time of one pass.
#[derive(Debug, Serialize)]
struct PassRow {
    pass: String,
    runs_per_frame: f64,
    /// Total time that the pass takes per frame, in microseconds.
    us_per_frame: f64,
}

/// The inputs of the measurement, which are the same for every backend.
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
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let watch = Stopwatch::new(&clock);
    if args.links {
        step("timing the links");
        let speeds = links::measure(args.frames as usize, watch)?;
        if args.json {
            print_json(&speeds);
        } else {
            print_links(&speeds);
        }
        return Ok(());
    }
    let (profile, scene) = args.set.load(&args.profile, &args.scene)?;
    let sequence = Firmware::new(&profile, &[])?.selected_sequence();
    let camera = &profile.camera;
    let pixels = camera.width_px as usize * camera.height_px as usize;
    let frame_bytes = pixels * camera.sensor.native_format().bytes_per_pixel();
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
    let mut runs = vec![time_cpu(&mut cpu, &subject)];
    runs.extend(gpu);
    step("timing the decoder");
    let (decoding, without_decoding) = match subject.decoding() {
        Ok(rows) => (rows, None),
        Err(e) => (Vec::new(), Some(e.to_string())),
    };
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
        decoding,
        without_decoding,
    };
    if args.json {
        print_json(&report);
    } else {
        print_tables(&report);
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
        // With motion, the geometry pass would run in every frame; `rates` times that case
        // separately.
        renderer.force(Term::Motion, false);
        Ok(renderer)
    }

    /// Returns the GPU's results, or the reason why a requested GPU was not timed.
    fn gpu(&self) -> Result<(Option<Run>, Option<String>)> {
        if self.args.backend == BackendArg::Cpu {
            return Ok((None, None));
        }
        let mut renderer = self.renderer(self.args.backend.into())?;
        let news = renderer.news()?;
        let Some(adapter) = renderer.adapter().cloned() else {
            return Ok((None, news));
        };
        step(&format!("timing the GPU, {}", adapter.name));
        let run = time_gpu(&mut renderer, self, adapter);
        // If the GPU failed, the CPU rendered in its place, so the times are not the GPU's.
        match renderer.news()? {
            Some(failed) => Ok((None, Some(failed))),
            None => Ok((Some(run), None)),
        }
    }

    /// Returns the times of decoding and of the checks that precede decoding.
    fn decoding(&self) -> Result<Vec<PassRow>> {
        let options = Options {
            samples: self.args.samples,
            ..Options::default()
        };
        let scanned = Stage::new(self.profile, self.scene, 1, options)?.scan(0)?;
        let decoder = scanned.decoder(DecodeOptions::default())?;
        // Decode once before timing, so that a sequence that cannot be decoded causes an error
        // here.
        decoder.decode(&scanned.images)?;
        let known = Known::new(false, scanned.calibration.as_ref());
        let (mut maps, mut points) = (Decoded::default(), Vec::new());
        let decode = || {
            let _ = black_box(decoder.decode_into(&scanned.images, &mut maps));
        };
        let decode_s = self.watch.fastest(ROUNDS, ROUND_S, decode);
        let check = || {
            let _ = black_box(check_sequence(&scanned.manifest, &scanned.images, known));
        };
        let check_s = self.watch.fastest(ROUNDS, ROUND_S, check);
        let triangulate = || {
            decoder.points_into(&maps, &mut points);
            black_box(&points);
        };
        let points_s = self.watch.fastest(ROUNDS, ROUND_S, triangulate);
        let frames = scanned.images.len() as f64;
        let row = |pass: &str, seconds: f64| PassRow {
            pass: pass.to_owned(),
            runs_per_frame: 1.0 / frames,
            us_per_frame: seconds * 1e6 / frames,
        };
        Ok(vec![
            row("decoding to depths", decode_s),
            row("checks of the frames", check_s),
            row("points", points_s),
        ])
    }
}

/// Times the CPU.
fn time_cpu(renderer: &mut Renderer, subject: &Subject<'_>) -> Run {
    let [still, moving] = rates(renderer, subject);
    let pixels = renderer.pixel_count() as f64;
    let mut timing = Timing::new(renderer, &subject.shots, subject.watch);
    let mut row = |name: &str, pass| PassRow {
        pass: name.to_owned(),
        runs_per_frame: 1.0,
        us_per_frame: timing.pass_ns(pass) * pixels * 1e-3,
    };
    Run {
        backend: "cpu",
        adapter: None,
        still,
        moving,
        passes: vec![
            row("geometry", Pass::Geometry),
            row("exposure and sensor", Pass::Exposure),
        ],
    }
}

/// Times the GPU that the renderer uses.
fn time_gpu(renderer: &mut Renderer, subject: &Subject<'_>, adapter: Adapter) -> Run {
    let [still, moving] = rates(renderer, subject);
    renderer.time_passes();
    let mut passes = Vec::new();
    let (begin, mut timed) = (Instant::now(), 0);
    for shot in subject.shots.iter().cycle().take(TIMED) {
        if timed > 0 && begin.elapsed().as_secs_f64() > ROUND_S {
            break;
        }
        timed += 1;
        renderer.invalidate();
        black_box(renderer.expose(shot));
        // Read the times after every frame, because the renderer stores the timestamps of only a
        // few passes.
        passes = renderer.pass_times().into_iter().collect();
    }
    let row = |(pass, time): (String, PassTime)| PassRow {
        pass,
        runs_per_frame: time.runs as f64 / f64::from(timed),
        us_per_frame: time.total_ns * 1e-3 / f64::from(timed),
    };
    let mut passes: Vec<PassRow> = passes.into_iter().map(row).collect();
    passes.sort_by(|a, b| b.us_per_frame.total_cmp(&a.us_per_frame));
    Run {
        backend: "gpu",
        adapter: Some(adapter),
        still,
        moving,
        passes,
    }
}

/// Returns the frame rates of a static scene and with the geometry pass in every frame.
fn rates(renderer: &mut Renderer, subject: &Subject<'_>) -> [Rate; 2] {
    [false, true].map(|moving| {
        let seconds = subject
            .watch
            .seconds_a_frame(subject.args.frames as usize, |count| {
                frames(renderer, &subject.shots, count, moving);
            });
        Rate {
            frames_per_s: 1.0 / seconds,
            over_copy: seconds / subject.copy,
        }
    })
}

/// Renders `count` frames, with as many frames in flight as `Renderer::depth` allows.
fn frames(renderer: &mut Renderer, shots: &[Shot], count: usize, moving: bool) {
    let mut under_way = VecDeque::new();
    for shot in shots.iter().cycle().take(count) {
        if under_way.len() == renderer.depth()
            && let Some(first) = under_way.pop_front()
        {
            black_box(renderer.finish(first));
        }
        if moving {
            renderer.invalidate();
        }
        under_way.push_back(renderer.submit(shot));
    }
    for pending in under_way {
        black_box(renderer.finish(pending));
    }
}

fn print_json(report: &impl Serialize) {
    let json = serde_json::to_string_pretty(report).expect("numbers and strings");
    println!("{json}");
}

/// Prints the speed of the links as a table.
fn print_links(speeds: &LinkSpeeds) {
    println!(
        "{:<22}{:>11}{:>11}{:>11}{:>11}{:>9}{:>9}{:>8}",
        "", "least ms", "median ms", "99 % ms", "frames/s", "MB/s", "x copy", "lost %"
    );
    for link in &speeds.links {
        let name = link.link;
        let Some(found) = &link.figures else {
            println!("{name:<22}{}", link.lacks.as_deref().unwrap_or_default());
            continue;
        };
        let [least, median, late, _] = found.latency_us.map(|us| us * 1e-3);
        let rate = found.frames_per_s[1];
        println!(
            "{name:<22}{least:>11.2}{median:>11.2}{late:>11.2}{rate:>11.1}{:>9.0}{:>9.1}{:>8.1}",
            rate * speeds.frame_bytes as f64 * 1e-6,
            1e6 / rate / speeds.copy_us,
            100.0 * found.lost as f64 / found.frames as f64
        );
    }
    println!(
        "\nms: from the trigger's command to the complete frame at the host, rendering included; \
         frames/s: of whole sequences; x copy: time per frame over a memory copy of its {} bytes, \
         {:.1} us.",
        speeds.frame_bytes, speeds.copy_us
    );
}

/// Prints the results as tables.
fn print_tables(report: &Report<'_>) {
    println!(
        "{} looking at {}: {} x {} pixels, {} triangles, {}, {} samples a pixel, {} threads",
        report.profile,
        report.scene,
        report.width,
        report.height,
        report.triangles,
        report.sequence,
        report.samples,
        report.threads
    );
    for adapter in report.runs.iter().filter_map(|run| run.adapter.as_ref()) {
        println!(
            "gpu: {} ({}), {}",
            adapter.name, adapter.kind, adapter.driver
        );
    }
    if let Some(why) = &report.without_gpu {
        println!("no gpu: {why}");
    }
    println!(
        "\n{:<8}{:>16}{:>12}{:>16}{:>12}",
        "", "still frames/s", "x copy", "moving frames/s", "x copy"
    );
    for run in &report.runs {
        let cells = |rate: &Rate| format!("{:>16.1}{:>12.1}", rate.frames_per_s, rate.over_copy);
        println!(
            "{:<8}{}{}",
            run.backend,
            cells(&run.still),
            cells(&run.moving)
        );
    }
    println!("\n{:<8}{:<28}{:>8}{:>12}", "", "pass", "runs", "us a frame");
    for run in &report.runs {
        for row in &run.passes {
            println!(
                "{:<8}{:<28}{:>8.1}{:>12.1}",
                run.backend, row.pass, row.runs_per_frame, row.us_per_frame
            );
        }
        if run.passes.is_empty() {
            println!(
                "{:<8}this adapter has no timestamps for passes",
                run.backend
            );
        }
    }
    for row in &report.decoding {
        println!(
            "{:<8}{:<28}{:>8.2}{:>12.1}",
            "cpu", row.pass, row.runs_per_frame, row.us_per_frame
        );
    }
    if let Some(why) = &report.without_decoding {
        println!("no decoding: {why}");
    }
    println!(
        "\nmoving: with the geometry pass in every frame, as are the passes' times; x copy: over a \
         memory copy of a frame's bytes, {:.1} us.",
        report.copy_us
    );
}
