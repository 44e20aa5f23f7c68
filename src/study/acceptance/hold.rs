//! Beam hold: device time from a jump of the couch to the end of the scan that detects the jump.

use super::answer::{part, track, worst};
use super::effort::Effort;
use super::subject::{Body, Subject};
use crate::clinic::Pods;
use phasmid_core::error::Result;
use phasmid_profile::{Keyframe, Motion, Shape};
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_sgrt::{
    Beam, Hold, HoldRules, POINTS, Quantity, Reading, RigidOptions, ScanWarning, Start, track_rigid,
};

/// Text above the tables.
const WORDS: &str = "The projectors take turns: a jump in the middle of a scan is seen only by the \
    pods that scan after it, and only the next scan sees it completely. The delay of the beam hold \
    therefore depends on when in a scan the patient moves.";

/// Upward jump and tolerance, in millimetres.
const JUMP_MM: f64 = 5.0;
const TOLERANCE_MM: f64 = 2.0;
/// Device time of the first scan in nanoseconds, then the number of scans before the one with the jump.
const BEGIN_NS: u64 = 1_000_000_000;
const BEFORE: u64 = 2;
/// Duration of the jump in nanoseconds.
const QUICK_NS: u64 = 1_000_000;

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    let one = |&share: &f64| {
        Trial::new(format!("hold/{share}"), settings.seed, move |context| {
            jumped(context, share, effort)
        })
    };
    effort.jumps.iter().map(one).collect()
}

/// Scans without a break until the beam is held. The couch jumps when the fraction `share` of a
/// scan has elapsed.
fn jumped(context: &Context<'_>, share: f64, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(Body::Torso)?;
    let reference = subject.reference()?;
    let adapt = |profile: &mut _| effort.adapt(profile);
    // Duration of one scan by all pods in turn.
    let period_ns: u64 = {
        let pods = Pods::new(&subject.scene, context.seed, &adapt)?;
        pods.all.iter().map(|pod| pod.turn_ns()).sum()
    };
    let jump_ns = BEGIN_NS + BEFORE * period_ns + (share * period_ns as f64) as u64;
    let mut scene = subject.scene.clone();
    for object in &mut scene.object {
        if object.shape != (Shape::LinacHead {}) {
            // Up is -z in the frames of couch and torso.
            object.motion = Some(jump(jump_ns));
        }
    }
    let mut pods = Pods::new(&scene, context.seed, &adapt)?;
    let mut hold = Hold::new(HoldRules {
        settle_ns: 0,
        ..HoldRules::default()
    })?;
    let mut start = None;
    let mut row = Row::new()
        .text("subject", "torso")
        .number("by", share)
        .number("period_ms", period_ns as f64 * 1e-6);
    let mut on = false;
    for k in 0..BEFORE + 4 {
        let begin_ns = BEGIN_NS + k * period_ns;
        let scan = pods.scan(begin_ns, false)?;
        let measured = pods.measured(&scan, POINTS);
        let fit = match start {
            None => track(&measured, &reference),
            Some(pose) => {
                let options = RigidOptions::default();
                track_rigid(&measured, &reference, &Start::Near(pose), &options)
            }
        };
        let mut reading = Reading::default();
        match &fit {
            Ok(fit) => {
                start = Some(fit.room_from_reference);
                reading.quantities.push(Quantity {
                    name: "place",
                    value: fit.six.translation_mm.length(),
                    deviation: fit.deviations()[..3].iter().copied().fold(0.0, f64::max),
                    tolerance: TOLERANCE_MM,
                });
                reading
                    .warnings
                    .extend(fit.warnings.iter().cloned().map(ScanWarning::Fit));
            }
            Err(lost) => reading.warnings.push(lost.clone().into()),
        }
        let end_ns = begin_ns + pods.duration_ns();
        match hold.update(end_ns, &reading) {
            Beam::On => on = true,
            // Ignore a hold before the beam was first on: it is not a response to the jump.
            Beam::Held(reason) if on && end_ns > jump_ns => {
                row = row
                    .number("hold_ms", (end_ns - jump_ns) as f64 * 1e-6)
                    .text("case", &reason.to_string());
                break;
            }
            Beam::Held(_) => {}
        }
    }
    Ok(vec![row])
}

/// Places keyframes close before and after the jump, so that the spline is constant except during the
/// jump.
fn jump(jump_ns: u64) -> Motion {
    let key = |steps: i64, up_mm: f64| Keyframe {
        time_s: (jump_ns as i64 + steps * QUICK_NS as i64) as f64 * 1e-9,
        position_mm: [0.0, 0.0, -up_mm],
        rotation_deg: [0.0; 3],
    };
    Motion {
        period_s: None,
        keyframes: vec![
            key(-2, 0.0),
            key(-1, 0.0),
            key(0, 0.0),
            key(1, JUMP_MM),
            key(2, JUMP_MM),
            key(3, JUMP_MM),
        ],
    }
}

/// Returns the longest time from the jump to the end of the scan that holds the beam, in milliseconds;
/// NaN if the beam was never held.
pub(super) fn longest_ms(rows: &Rows) -> f64 {
    worst(part(rows, "hold").map(|row| row.value("hold_ms")))
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut table = Table::new(
        "acceptance-hold",
        format!(
            "The couch jumps up by {JUMP_MM} mm after the given share of a scan; the tolerance is \
             {TOLERANCE_MM} mm. Device time in milliseconds from the jump to the end of the scan \
             that holds the beam, and the reason for the hold. The host's time comes on top."
        ),
        &["jump at fraction of scan", "held after", "reason"],
    );
    for row in part(rows, "hold") {
        let ms = row.value("hold_ms");
        table.row([
            row.get("by").to_owned(),
            if ms.is_finite() {
                format!("{ms:.1}")
            } else {
                "never".to_owned()
            },
            row.get("case").to_owned(),
        ]);
    }
    let mut blocks = vec![Block::Words(WORDS.to_owned()), Block::Table(table)];
    let mut periods = part(rows, "hold").map(|row| row.value("period_ms"));
    if let Some(period_ms) = periods.next() {
        // The scan after the one with the jump sees the jump completely.
        blocks.push(Block::Checks(vec![Check::at_most(
            "device time from a jump to the beam-hold, in ms",
            longest_ms(rows),
            2.0 * period_ms,
        )]));
    }
    Section::new("Beam-hold", blocks)
}
