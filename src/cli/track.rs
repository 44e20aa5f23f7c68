//! `phasmid track`: follows a patient and the tumour live, through the ports of the pods.

mod scan_deadline;
mod span;
mod table;

use super::pods::{Address, PodArgs, Source, Taken};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_host::doubt;
use phasmid_planning::planning::Planning;
use phasmid_sgrt::{
    Answers, Beam, Follower, Hold, HoldRules, Measured, ModelOptions, POINTS, Planned, Quantity,
    Reading, Region, Sight,
};
use scan_deadline::{FOREVER, ScanDeadline};
use span::Span;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};
use table::{Row, Table};

/// Maximum tolerance in millimetres.
const MOST_TOLERANCE_MM: f64 = 1000.0;

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
    /// File for the lines [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite an existing file.
    #[arg(long, requires = "out")]
    force: bool,
    /// Maximum distance of the tumour from its planned position in millimetres, 0.001 to 1000.
    #[arg(long, value_name = "MM", default_value_t = 5.0)]
    tolerance_mm: f64,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let timeout = args.pods.timeout()?;
    if !(0.001..=MOST_TOLERANCE_MM).contains(&args.tolerance_mm) {
        return Err(Error::input(
            "--tolerance-mm",
            args.tolerance_mm,
            format!("0.001 to {MOST_TOLERANCE_MM}"),
        ));
    }
    let station = args.pods.station()?;
    if args.scans == Some(0) {
        return Err(Error::input("--scans", 0, "1 or more"));
    }
    if let Some(path) = &args.out {
        new_file::check(path, args.force)?;
    }
    super::step("planning");
    let planning = Planning::load(&args.planning).map_err(|e| e.at("--planning"))?;
    let planned = Planned::new(&planning, &Region::chest(), &ModelOptions::default())?;
    let pods = args.pods.addresses(&station)?;
    // The channel holds one scan per pod, so the pods never scan further ahead than that.
    let (send, taken) = sync_channel(pods.len());
    std::thread::scope(|threads| {
        let (from, scans) = (&pods, args.scans);
        let scanning = std::thread::Builder::new()
            .name("pods".into())
            .spawn_scoped(threads, move || scan(from, timeout, scans, &send));
        let scanning = scanning.map_err(|e| Error::device(format!("cannot start thread: {e}")))?;
        let followed = follow(args, &planned, &pods, &taken);
        // Ends the scanning thread at its next send.
        drop(taken);
        let scanned = scanning
            .join()
            .unwrap_or_else(|_| Err(Error::device("the thread of the pods panicked")));
        // An error at the ports takes precedence: it is the reason why the scans ended.
        scanned.and(followed)
    })
}

/// Scans with one pod after the other, because their projectors take turns, while earlier scans are
/// evaluated.
fn scan(
    pods: &[Address],
    timeout: Duration,
    scans: Option<u64>,
    to: &SyncSender<Taken>,
) -> Result<()> {
    let mut sources = Vec::new();
    for pod in pods {
        sources.push(Source::open(pod, timeout)?.without_checks());
    }
    let mut scanned = Ok(());
    let mut count = 0;
    'scans: while scans.is_none_or(|scans| count < scans) {
        for source in &mut sources {
            let taken = match source.scan() {
                Ok(taken) => taken,
                Err(e) => {
                    scanned = Err(e);
                    break 'scans;
                }
            };
            if to.send(taken).is_err() {
                break 'scans;
            }
        }
        count += 1;
    }
    for source in sources {
        let finished = source.finish();
        scanned = scanned.and(finished);
    }
    scanned
}

/// Fits, decides and reports, scan by scan, until the scans end.
fn follow(args: &Args, planned: &Planned, pods: &[Address], scans: &Receiver<Taken>) -> Result<()> {
    let mut hold = Hold::new(HoldRules::default())?;
    let mut follower = Follower::new(planned)?;
    let sight = |pod: &Address| Sight::new(&pod.name, pod.room_from_rig);
    let mut sights: Vec<Sight> = pods.iter().map(sight).collect();
    let target = planned.tumour_mm();
    let begin = Instant::now();
    let modes = planned.model.components();
    let mut table = Table::new(args.out.as_deref(), args.force, begin, modes);
    let mut scan_deadline = ScanDeadline::new(hold.stale());
    let most = POINTS / pods.len().max(1);
    let mut count = 0;
    'scans: loop {
        let mut measured = Measured::default();
        let mut reading = Reading::default();
        let mut span = Span::default();
        let (mut last_frame, mut decoding) = (begin, Duration::ZERO);
        for (sight, pod) in sights.iter_mut().zip(pods) {
            let mut silence = scan_deadline.left(Instant::now());
            let taken = loop {
                match scans.recv_timeout(silence) {
                    Ok(taken) => break taken,
                    Err(RecvTimeoutError::Timeout) => {
                        // Holds the beam before anything else is known, and reports that once.
                        table.silent(count, hold.silent())?;
                        silence = FOREVER;
                    }
                    Err(RecvTimeoutError::Disconnected) => {
                        if args.scans != Some(count) && *hold.beam() == Beam::On {
                            table.silent(count, hold.silent())?;
                        }
                        break 'scans;
                    }
                }
            };
            if count == 0
                && let Some(why) = doubt(&taken.captured.manifest, &taken.captured.images)
            {
                eprintln!("phasmid: {}: {why}", pod.name);
            }
            let arrived = Instant::now();
            let doubt = sight.measure(&taken.captured, taken.identified, &mut measured, most)?;
            reading.warnings.extend(doubt);
            decoding += arrived.elapsed();
            span.take(&taken.captured.frames);
            last_frame = taken.arrived.max(last_frame);
        }
        scan_deadline.heard(Instant::now());
        let Answers { rigid, motion: fit } = follower.answer(&measured);
        match &fit {
            Ok(fit) => {
                let off = fit.tumour_mm - target;
                let along = off.normalize_or(DVec3::Z);
                let variance = along.dot(fit.total_covariance(target) * along);
                reading.quantities.push(Quantity {
                    name: "tumour",
                    value: off.length(),
                    deviation: variance.max(0.0).sqrt(),
                    tolerance: args.tolerance_mm,
                });
                let warnings = fit.warnings.iter().map(ToString::to_string);
                reading.warnings.extend(warnings);
            }
            Err(lost) => reading.warnings.push(lost.to_string()),
        }
        let host_ms = last_frame.elapsed().as_secs_f64() * 1e3;
        let beam: Beam = hold.update(span.end_ns, &reading).clone();
        table.row(&Row {
            scan: count,
            device_s: span.end_ns as f64 * 1e-9,
            rigid: rigid.as_ref().ok(),
            motion: fit.as_ref().ok(),
            target,
            points: measured.len(),
            decode_ms: decoding.as_secs_f64() * 1e3,
            host_ms,
            since_motion_ms: span.middle_to_end_ms().map(|device_ms| device_ms + host_ms),
            beam: &beam,
            warnings: &warnings(&rigid, &reading),
        })?;
        count += 1;
    }
    Ok(())
}

/// Returns the warnings of the rigid fit, followed by the warnings of the reading.
fn warnings(
    rigid: &std::result::Result<phasmid_sgrt::RigidFit, phasmid_sgrt::Lost>,
    reading: &Reading,
) -> Vec<String> {
    let mut all = match rigid {
        Ok(rigid) => rigid
            .warnings
            .iter()
            .map(|w| format!("rigid: {w}"))
            .collect(),
        Err(lost) => vec![format!("rigid: {lost}")],
    };
    all.extend(reading.warnings.iter().cloned());
    all
}
