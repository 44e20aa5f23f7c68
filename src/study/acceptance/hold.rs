//! Beam-hold: from a jump of the couch to the scan that tells of it, in device time.

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

/// The words above the tables.
const WORDS: &str = "The projectors take turns, so that a jump in the middle of a scan is \
    seen by the pods that come after it, and only the next scan has it whole. How soon the beam is held \
    depends on when in a scan the patient moves.";

/// The jump upwards and the tolerance, in millimetres.
const JUMP_MM: f64 = 5.0;
const TOLERANCE_MM: f64 = 2.0;
/// Device time of the first scan, and scans before the one during which the couch jumps.
const BEGIN_NS: u64 = 1_000_000_000;
const BEFORE: u64 = 2;
/// How long the jump takes in nanoseconds.
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

/// The couch jumps when a scan is over to a share; scans follow each other without a break until the
/// beam is held.
fn jumped(context: &Context<'_>, share: f64, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(Body::Torso)?;
    let reference = subject.reference()?;
    let adapt = |profile: &mut _| effort.adapt(profile);
    // All pods in turn, then the first one again.
    let period_ns: u64 = {
        let pods = Pods::new(&subject.scene, context.seed, &adapt)?;
        pods.all.iter().map(|pod| pod.turn_ns()).sum()
    };
    let jump_ns = BEGIN_NS + BEFORE * period_ns + (share * period_ns as f64) as u64;
    let mut scene = subject.scene.clone();
    for object in &mut scene.object {
        if object.shape != (Shape::LinacHead {}) {
            // Couch and torso lie on their backs: up is their -z.
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
            // Held before it was ever on is no answer to the jump.
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

/// Keyframes close before and after the jump, so that the spline stands still but for it.
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

/// The longest time from the jump to the end of the scan that holds the beam, in milliseconds: NaN
/// where none did.
pub(super) fn longest_ms(rows: &Rows) -> f64 {
    worst(part(rows, "hold").map(|row| row.value("hold_ms")))
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut table = Table::new(
        "acceptance-hold",
        format!(
            "The couch jumps up by {JUMP_MM} mm at a share of a scan, the tolerance is {TOLERANCE_MM} \
             mm: device time in milliseconds from the jump to the end of the scan by which the beam is \
             held, and why. The host's time comes on top."
        ),
        &["jump at a share of", "held after", "because"],
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
        // The next whole scan after the one in which it jumps sees all of it.
        blocks.push(Block::Checks(vec![Check::at_most(
            "device time from a jump to the beam-hold, in ms",
            longest_ms(rows),
            2.0 * period_ms,
        )]));
    }
    Section::new("Beam-hold", blocks)
}
