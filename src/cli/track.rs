//! `phasmid track`: follows a patient and the tumour live, through the ports of the pods.

#[cfg(feature = "console")]
mod console;
#[cfg(not(feature = "console"))]
#[path = "track/without_console.rs"]
mod console;
mod table;

use super::interrupt::check;
use super::pods::PodArgs;
use super::progress::ProgressLine;
use crate::facade::TOLERANCE_MM;
use crate::{Pod, TrackOptions, TrackProgress, Tracked};
use console::Page;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_planning::planning::Planning;
use phasmid_sgrt::{Beam, ModelOptions, Planned, Reason, Region};
use std::ops::{ControlFlow, RangeInclusive};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use table::Table;

/// Allowed values of `--seconds`.
const SECONDS: RangeInclusive<f64> = 0.001..=1e6;

/// Follow a patient's skin and tumour live with one or several pods: six degrees of freedom, the tumour's
/// position with its standard deviation, beam hold and latency, as one line of CSV per scan
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  phasmid track --run-dir ceiling --planning planning --out track.csv"
)]
pub(super) struct Args {
    #[command(flatten)]
    pods: PodArgs,
    /// Planning folder of the patient, as `phasmid patient plan` and `phasmid patient import` write
    /// it.
    #[arg(long, value_name = "DIR")]
    planning: PathBuf,
    /// Number of scans [default: unlimited].
    #[arg(long, value_name = "N")]
    scans: Option<u64>,
    /// Seconds of device time after the first scan, 0.001 to 1000000 [default: unlimited]. With --scans,
    /// tracking ends at whichever comes first.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// File for the lines [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite an existing file.
    #[arg(long, requires = "out")]
    force: bool,
    /// Maximum distance of the tumour from its planned position in millimetres, 0.001 to 1000.
    #[arg(long, value_name = "MM", default_value_t = 5.0)]
    tolerance_mm: f64,
    /// Also serve a page for the browser that shows the room, the patient and the pods, on this port of the
    /// loopback interface; without a port, on a free one. Prints its addresses on standard error.
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "0")]
    console: Option<u16>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let timeout = args.pods.timeout()?;
    if !TOLERANCE_MM.contains(&args.tolerance_mm) {
        let (least, most) = (TOLERANCE_MM.start(), TOLERANCE_MM.end());
        let allowed = format!("{least} to {most}");
        return Err(Error::input("--tolerance-mm", args.tolerance_mm, allowed));
    }
    let station = args.pods.station()?;
    if args.scans == Some(0) {
        return Err(Error::input("--scans", 0, "1 or more"));
    }
    let seconds = args.seconds.filter(|s| !SECONDS.contains(s));
    if let Some(seconds) = seconds {
        let allowed = format!("{} to {}", SECONDS.start(), SECONDS.end());
        return Err(Error::input("--seconds", seconds, allowed));
    }
    if let Some(path) = &args.out {
        new_file::check(path, args.force)?;
    }
    super::output::step("planning");
    let planning = Planning::load(&args.planning).map_err(|e| e.at("--planning"))?;
    let planned = Planned::new(&planning, &Region::chest(), &ModelOptions::default())?;
    let pods = args.pods.addresses(&station)?;
    let modes = planned.model.components();
    let mut table = Table::new(args.out.as_deref(), args.force, Instant::now(), modes);
    let options = TrackOptions {
        tolerance_mm: args.tolerance_mm,
        scans: args.scans,
        duration: args.seconds.map(Duration::from_secs_f64),
        ..TrackOptions::default()
    };
    let mut page = Page::start(args.console, &planned, &pods, &options)?;
    let pods = { pods.iter().enumerate() }.map(|(i, pod)| pod.pod(timeout, page.observer(i)));
    let mut pods = pods.collect::<Result<Vec<_>>>()?;
    // If the CSV lines go to standard output, they show the progress, so no progress line is
    // needed.
    let line = args.out.as_ref().map(|_| ProgressLine::new("tracking"));
    // Number of the next scan while the beam is on; `None` while it is held.
    let mut on = None;
    let mut reported = Ok(());
    let tracked = crate::track(&mut pods, &planned, &options, |progress| {
        if let Some(line) = &line {
            show(line, progress, args.scans);
        }
        if let TrackProgress::Scan(tracked) = progress {
            hint(tracked);
        }
        reported = report(progress, &mut table, &mut on).and_then(|()| check());
        page.show(&progress);
        match reported {
            Ok(()) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        }
    });
    drop(line);
    if let Some(scan) = on.filter(|_| matches!(reported, Err(Error::Interrupted))) {
        // If a signal ended the scans while the beam was on, add a line that states that the beam
        // is held.
        let held = table.silent(scan, &Beam::Held(Reason::Stale));
        reported = held.and(reported);
    }
    if args.scans.is_none() && args.seconds.is_none() && matches!(reported, Err(Error::Interrupted))
    {
        // Without `--scans` and `--seconds`, a signal is the usual end of tracking and not an
        // error.
        reported = Ok(());
    }
    let finished: Vec<_> = pods.into_iter().map(Pod::finish).collect();
    tracked.and(reported).and(finished.into_iter().collect())
}

/// Says what to check if the first scan shows no skin.
fn hint(first: &Tracked) {
    if first.scan == 0 && first.skin.is_none() && first.tumour.is_none() {
        eprintln!(
            "phasmid: no skin in sight, found {} points; check the poses of the pods in the station \
             (--station), and the exposure, the sequence and the image size or binning of each pod; \
             `phasmid scan` shows what one pod measures, and `phasmid plan` what an emulated one renders",
            first.points
        );
    }
}

/// Shows the latest scan and the state of the beam in the progress line. Scans are numbered as in
/// the table.
fn show(line: &ProgressLine, progress: TrackProgress<'_>, scans: Option<u64>) {
    let (scan, beam, tumour) = match progress {
        TrackProgress::Scan(tracked) => {
            if let Some(scans) = scans {
                line.show(tracked.scan as usize + 1, scans as usize);
            }
            (tracked.scan, &tracked.beam, tracked.tumour.as_ref())
        }
        TrackProgress::Overdue { scan, beam } => (scan, beam, None),
        _ => return,
    };
    let off = tumour.map_or(String::new(), |tumour| {
        format!(", tumour {:.1} mm off", tumour.off_mm)
    });
    // The reason comes last, because the end of a long line is cut off.
    line.remark(match beam {
        Beam::On => format!("scan {scan}: beam on{off}"),
        Beam::Held(reason) => format!("scan {scan}: beam held{off}: {reason}"),
    });
}

/// Writes a progress report of tracking to the table, and updates `on`: the number of the next scan
/// while the beam is on.
fn report(progress: TrackProgress<'_>, table: &mut Table, on: &mut Option<u64>) -> Result<()> {
    match progress {
        TrackProgress::Scan(tracked) => {
            *on = (tracked.beam == Beam::On).then_some(tracked.scan + 1);
            table.row(tracked)
        }
        TrackProgress::Overdue { scan, beam } => {
            *on = None;
            table.silent(scan, beam)
        }
        TrackProgress::Doubtful { pod, why } => {
            eprintln!("phasmid: {pod}: {why}");
            Ok(())
        }
        TrackProgress::Surface { .. } | TrackProgress::Waiting => Ok(()),
    }
}
