//! `phasma track`: follows a patient and the tumour through the ports of the pods, live.

mod pod;
mod table;

use crate::error::{Error, Result};
use crate::geometry::Pose;
use crate::host::track::{
    Beam, FitOptions, Hold, HoldRules, Measured, ModelOptions, MotionState, MotionTracker, POINTS,
    Planned, Quantity, Reading, Region, RigidOptions, Start, track_rigid,
};
use crate::patient::planning::Planning;
use crate::profile::{Configuration, Station};
use glam::DVec3;
use pod::Pod;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use table::{Row, Table};

/// How far off a patient is looked for at first.
const RANGE_MM: f64 = 50.0;
/// Longest timeout in seconds.
const MAX_TIMEOUT_S: f64 = 3600.0;

/// Follow a patient's skin and tumour through the ports of one or several pods: six degrees of freedom,
/// the tumour's place with its deviation, beam-hold, latency, a line of CSV a scan
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Run directory of a served station: each of its devices in a folder of its name.
    #[arg(
        long,
        value_name = "DIR",
        required_unless_present = "pod",
        conflicts_with = "pod"
    )]
    run_dir: Option<PathBuf>,
    /// A pod by its ports: its name in the station, its camera and its control port. Once for each.
    #[arg(long, value_name = "NAME=CAMERA,CONTROL")]
    pod: Vec<String>,
    /// Where the pods stand in the room: a station's name or file.
    #[arg(long, value_name = "STATION", default_value = "sgrt-ceiling")]
    station: String,
    /// What planning knows of the patient, as `phasma patient plan` and `phasma patient import`
    /// write it.
    #[arg(long, value_name = "DIR")]
    planning: PathBuf,
    /// Scans to make; without end when absent.
    #[arg(long, value_name = "N")]
    scans: Option<u64>,
    /// File for the lines; standard output when absent.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// How far the tumour may be from where it was planned, in millimetres.
    #[arg(long, value_name = "MM", default_value_t = 5.0)]
    tolerance_mm: f64,
    /// Seconds to wait for a reply or a frame.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    timeout: f64,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let within = |name: &str, value: f64, most: f64| match (0.001..=most).contains(&value) {
        true => Ok(()),
        false => Err(Error::input(name, value, format!("0.001 to {most}"))),
    };
    within("--timeout", args.timeout, MAX_TIMEOUT_S)?;
    within("--tolerance-mm", args.tolerance_mm, 1000.0)?;
    let Configuration::Station(station) = Configuration::load(&args.station)? else {
        return Err(Error::input(
            format!("--station {}", args.station),
            "a device",
            "a station, which says where its devices stand",
        ));
    };
    let table = Table::create(args.out.as_deref())?;
    super::step("planning");
    let planning = Planning::load(&args.planning)?;
    let planned = Planned::new(&planning, &Region::chest(), &ModelOptions::default())?;
    let mut pods = pods(args, &station)?;
    let followed = follow(args, &planned, &mut pods, table);
    for pod in pods {
        pod.finish()?;
    }
    followed
}

fn pods(args: &Args, station: &Station) -> Result<Vec<Pod>> {
    let timeout = Duration::from_secs_f64(args.timeout);
    match &args.run_dir {
        Some(folder) => station
            .device
            .iter()
            .map(|device| Pod::of_run_dir(device, &folder.join(&device.name), timeout))
            .collect(),
        None => args
            .pod
            .iter()
            .map(|text| Pod::of_ports(text, station, timeout))
            .collect(),
    }
}

/// Scans, fits, decides and tells, until told to stop.
fn follow(args: &Args, planned: &Planned, pods: &mut [Pod], mut table: Table) -> Result<()> {
    let mut hold = Hold::new(HoldRules::default())?;
    let options = FitOptions::by_hand();
    let tracker = MotionTracker::new(&planned.reference, &planned.model, Pose::IDENTITY, &options)?;
    let mut state = MotionState::mean(&planned.model);
    let mut start = Start::Within {
        around: Pose::IDENTITY,
        range_mm: RANGE_MM,
    };
    let target = planned.tumour_mm();
    let begin = Instant::now();
    let most = POINTS / pods.len().max(1);
    let mut count = 0;
    while args.scans.is_none_or(|scans| count < scans) {
        // Their projectors take turns.
        let mut time_ns = 0;
        for pod in pods.iter_mut() {
            time_ns = pod.scan()?.max(time_ns);
        }
        let last_frame = Instant::now();
        let mut measured = Measured::default();
        for pod in pods.iter_mut() {
            pod.measure(&mut measured, most)?;
        }
        let decoded = Instant::now();
        let rigid = track_rigid(
            &measured,
            &planned.reference,
            &start,
            &RigidOptions::default(),
        );
        let fit = tracker.fit(&measured, &state);
        let mut reading = Reading::default();
        if let Ok(rigid) = &rigid {
            start = Start::Near(rigid.room_from_reference);
        }
        match &fit {
            Ok(fit) => {
                let off = fit.tumour_mm - target;
                let along = off.normalize_or(DVec3::Z);
                let variance = along.dot(fit.tumour_covariance * along);
                reading.quantities.push(Quantity {
                    name: "tumour",
                    value: off.length(),
                    deviation: variance.max(0.0).sqrt(),
                    tolerance: args.tolerance_mm,
                });
                reading
                    .warnings
                    .extend(fit.warnings.iter().map(ToString::to_string));
                state = fit.state.clone();
            }
            Err(lost) => {
                reading.warnings.push(lost.to_string());
                state = MotionState::mean(&planned.model);
            }
        }
        let host_ms = last_frame.elapsed().as_secs_f64() * 1e3;
        let beam: Beam = hold.update(time_ns, &reading).clone();
        table.row(&Row {
            scan: count,
            host_s: begin.elapsed().as_secs_f64(),
            device_s: time_ns as f64 * 1e-9,
            rigid: rigid.as_ref().ok(),
            motion: fit.as_ref().ok(),
            target,
            points: measured.len(),
            decode_ms: (decoded - last_frame).as_secs_f64() * 1e3,
            host_ms,
            beam: &beam,
            warnings: &warnings(&rigid, &reading),
        })?;
        count += 1;
    }
    table.finish()
}

/// All that is to be doubted, of both answers.
fn warnings(
    rigid: &std::result::Result<crate::host::track::RigidFit, crate::host::track::Lost>,
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
