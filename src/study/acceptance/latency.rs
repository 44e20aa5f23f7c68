//! Latency from a motion to the result: the device time of a scan by three pods plus the host's time.

use super::answer::part;
use super::effort::Effort;
use super::hold;
use crate::clinic::{InRoom, Pod, Pods};
use crate::timing::quantile;
use phasmid_core::error::Result;
use phasmid_decode::Capture;
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_sgrt::{Follower, Measured, POINTS, Region, Sight};

/// Text above the tables.
const WORDS: &str = "Latency is the emulated device's time plus the host's time, which is \
    measured. Pods of full resolution scan a breathing patient. Each scan is tracked from the \
    result of the previous one, rigidly and with the motion model, as in `phasmid track`: the \
    frames are checked against their sequence, and every second pixel of every second row is \
    decoded, which still gives several times the points that are fitted. The frames of a pod are \
    processed while the next pod scans, so that only the last pod's frames remain after the last \
    frame; the host's time for a whole scan limits the scan rate. Frames are in memory; `phasmid \
    bench --links` measures how long a link takes to carry them. The quick form runs beside other \
    tests, so that its times are not checked.";

/// Maximum host time in milliseconds: from the last frame to the pose, then per scan in continuous
/// operation.
const HOST_MS: f64 = 250.0;
const SUSTAINED_MS: f64 = 90.0;
/// Maximum total latency in milliseconds that a clinic tolerates.
const TOTAL_MS: f64 = 500.0;
/// When treatment begins, in nanoseconds of device time.
const BEGIN_NS: u64 = 60_000_000_000;
/// Time between scans in nanoseconds, during which a breathing patient moves some millimetres.
const APART_NS: u64 = 400_000_000;
/// Label of the first scan, which also sets up everything that is computed only once.
const FIRST: &str = "first scan";
/// Parts of the host's time: columns and their labels.
const PARTS: [(&str, &str); 4] = [
    (
        "look_ms",
        "host: frames of three pods checked and converted to points",
    ),
    ("fit_ms", "host: rigid pose and tumour, fitted in parallel"),
    (
        "host_ms",
        "host: from the last pod's last frame to both answers",
    ),
    ("scan_ms", "host: whole evaluation of a scan"),
];

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    let trial = Trial::new("latency/patient", settings.seed, move |context| {
        timed(context, effort)
    });
    // The trial runs alone, so that no other trial uses the cores.
    vec![trial.alone()]
}

/// Times the tracking of a breathing patient by pods of full resolution. A few scans are repeated, and
/// each is tracked from the previous result.
fn timed(context: &Context<'_>, effort: Effort) -> Result<Vec<Row>> {
    let scratch = context.folder.place("planning-latency")?;
    let room = InRoom::new("p02-man-mean", &Region::chest(), &scratch)?;
    let mut pods = Pods::new(&room.scene, context.seed, &|_| {})?;
    let mut scans: Vec<Vec<Capture>> = Vec::new();
    for k in 0..effort.timed_scans {
        let then_ns = BEGIN_NS + k as u64 * APART_NS;
        let scan = |pod: &mut Pod| pod.scan(then_ns, Some(then_ns));
        scans.push(pods.all.iter_mut().map(scan).collect::<Result<_>>()?);
    }
    let most = POINTS / pods.all.len();
    let sight = |pod: &Pod| Sight::new("pod", pod.room_from_rig());
    let mut sights: Vec<Sight> = pods.all.iter().map(sight).collect();
    let mut follower = Follower::new(&room.planned)?;
    let mut rows = Vec::new();
    for round in 0..=effort.timed_rounds {
        let Some(scan) = scans.get(round % scans.len().max(1)) else {
            break;
        };
        let mut measured = Measured::default();
        let (mut looked_s, mut last_s, mut doubts) = (0.0, 0.0, 0);
        for (sight, captured) in sights.iter_mut().zip(scan) {
            let (doubt, seconds) =
                context.timed(|| sight.measure(captured, true, &mut measured, most));
            doubts += usize::from(doubt?.is_some());
            looked_s += seconds;
            last_s = seconds;
        }
        let (answers, fit_s) = context.timed(|| follower.answer(&measured));
        let lost = usize::from(answers.rigid.is_err()) + usize::from(answers.motion.is_err());
        rows.push(
            Row::new()
                // The first scan searches from far away and includes one-time set-up, so it has its own
                // line.
                .text("subject", if round > 0 { "patient" } else { FIRST })
                .number("device_ms", pods.duration_ns() as f64 * 1e-6)
                .number("look_ms", looked_s * 1e3)
                .number("fit_ms", fit_s * 1e3)
                .number("host_ms", (last_s + fit_s) * 1e3)
                .number("scan_ms", (looked_s + fit_s) * 1e3)
                .number("lost", (lost + doubts) as f64),
        );
    }
    Ok(rows)
}

/// Returns the sorted values of a column.
fn sorted(rows: &Rows, column: &str) -> Vec<f64> {
    let usual = part(rows, "latency").filter(|row| row.get("subject") != FIRST);
    let mut all: Vec<f64> = usual.map(|row| row.value(column)).collect();
    all.sort_by(f64::total_cmp);
    all
}

pub(super) fn section(rows: &Rows, settings: &Settings) -> Section {
    let mut blocks = vec![Block::Words(WORDS.to_owned())];
    if part(rows, "latency").next().is_some() {
        blocks.push(Block::Table(table(rows)));
        blocks.push(Block::Checks(checks(rows, settings)));
    }
    Section::new("Latency", blocks)
}

fn table(rows: &Rows) -> Table {
    let device = sorted(rows, "device_ms");
    let host = sorted(rows, "host_ms");
    let mut table = Table::new(
        "acceptance-latency",
        format!(
            "Milliseconds over {} scans, on all available cores: device time, and the host's time, \
             measured beside whatever else ran on the host.",
            host.len()
        ),
        &["", "median", "worst", "allowed"],
    )
    .timed();
    let mut row = |name: &str, [median, worst]: [f64; 2], allowed: &str| {
        table.row([
            name.to_owned(),
            format!("{median:.1}"),
            format!("{worst:.1}"),
            allowed.to_owned(),
        ]);
    };
    let [median, worst] = [0.5, 1.0].map(|share| quantile(&device, share));
    row("device: a scan by three pods", [median, worst], "-");
    for (column, name) in PARTS {
        let all = sorted(rows, column);
        let allowed = match column {
            "host_ms" => format!("{HOST_MS}"),
            "scan_ms" => format!("{SUSTAINED_MS}"),
            _ => "-".to_owned(),
        };
        row(
            name,
            [0.5, 1.0].map(|share| quantile(&all, share)),
            &allowed,
        );
    }
    let first = part(rows, "latency").find(|row| row.get("subject") == FIRST);
    if let Some(first) = first {
        let ms = first.value("host_ms");
        row(
            "host: first scan with one-time set-up, from the last frame to both answers",
            [ms, ms],
            "-",
        );
    }
    let hosts = [0.5, 1.0].map(|share| quantile(&host, share));
    let total = [median + hosts[0], worst + hosts[1]];
    row(
        "from the start of a scan to its results",
        total,
        &format!("{TOTAL_MS}"),
    );
    let held = hold::longest_ms(rows);
    if held.is_finite() {
        let total = hosts.map(|host| held + host);
        row(
            "from a jump at the worst moment to the beam-hold",
            total,
            &format!("{TOTAL_MS}"),
        );
    }
    table
}

/// Checks the results and, except in the quick form, the times. The quick form runs beside other tests,
/// which slow it down.
fn checks(rows: &Rows, settings: &Settings) -> Vec<Check> {
    let lost: f64 = part(rows, "latency").map(|row| row.value("lost")).sum();
    let mut checks = vec![Check::at_most("missing results", lost, 0.0)];
    if !settings.quick {
        let (host, device) = (sorted(rows, "host_ms"), sorted(rows, "device_ms"));
        let worst_ms = quantile(&host, 1.0);
        checks.extend([
            Check::at_most("host time from the last frame, in ms", worst_ms, HOST_MS),
            Check::at_most(
                "host time per scan in continuous operation, in ms",
                quantile(&sorted(rows, "scan_ms"), 0.5),
                SUSTAINED_MS,
            ),
            Check::at_most(
                "from the start of a scan to its results, in ms",
                quantile(&device, 1.0) + worst_ms,
                TOTAL_MS,
            ),
        ]);
    }
    checks
}
