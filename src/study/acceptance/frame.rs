//! The common frame of the pods: pods that deviate from their drawings and their planned places are
//! calibrated with one board and located with another.

use super::answer::{answered, doubted, part, rms, shift_mm, track, turn_deg, worst};
use super::effort::Effort;
use super::known::BAR;
use super::subject::{Body, Subject, everywhere, time_ns};
use crate::boards::{seen_in, shown_to};
use crate::clinic::{Pod, Pods};
use phasmid_calibrate::rig::{Task, calibrate, place};
use phasmid_calibrate::solve::Choice;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::board_poses::{Wanted, poses};
use phasmid_geometry::{Board, MeshTree, Pose, Rig};
use phasmid_profile::{Profile, RigPlace, Scene, Shape};
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_sgrt::{POINTS, Reference, Region, SixDof};

/// Text above the tables.
const WORDS: &str = "Elsewhere, except for the warmed pods of the section on drift, pods match \
    their profile and stand where the station says. Here each pod has manufacturing errors \
    (projector and focal length) and hangs a millimetre or so from its planned place. A board in \
    many poses calibrates each pod, as `phasmid calibrate` does; a board at the isocentre, seen by \
    all pods, locates them, as `phasmid locate` does. The table compares the results with those \
    without either step, and with those of pods that are known exactly.";

/// The room with the board that locates the pods.
const BOARD_ROOM: &str = "treatment-room-board";
/// Deviation of each built pod from its drawing (assumed mechanical tolerances): position of the
/// projector in millimetres, its rotation in degrees, and a factor on the camera's focal length.
const BUILT: [([f64; 3], f64, f64); 3] = [
    ([0.8, -0.3, 0.4], 0.10, 1.002),
    ([-0.6, 0.5, -0.2], -0.08, 0.999),
    ([0.5, 0.2, -0.6], 0.06, 1.001),
];
/// Deviation of each pod from its planned place, in millimetres and degrees, as after a collision.
const KNOCKED: [([f64; 3], [f64; 3]); 3] = [
    ([1.2, 0.9, 0.7], [0.06, 0.05, 0.05]),
    ([-0.4, 1.1, -0.8], [-0.04, 0.07, -0.03]),
    ([0.7, -1.0, 0.3], [0.05, -0.03, 0.06]),
];
/// Maximum distance in millimetres from the surface at which a point counts as part of the torso.
const NEAR_MM: f64 = 5.0;
/// Poses and calibrations with which points are transformed into the room, from the worst to the best.
const CASES: [&str; 4] = [
    "nominal calibration and pose",
    "nominal calibration, located by a board",
    "calibrated, located by a board",
    "true calibration and pose",
];

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    vec![Trial::new("frame/torso", settings.seed, move |context| {
        framed(context, effort)
    })]
}

fn as_built(number: usize, profile: &mut Profile, place: &mut RigPlace) {
    let (moved, turned, longer) = BUILT[number % BUILT.len()];
    for k in 0..3 {
        profile.projector.position_mm[k] += moved[k];
    }
    profile.projector.rotation_deg[1] += turned;
    profile.camera.focal_length_mm *= longer;
    let (moved, turned) = KNOCKED[number % KNOCKED.len()];
    for k in 0..3 {
        place.position_mm[k] += moved[k];
        place.rotation_deg[k] += turned[k];
    }
}

/// The calibration and the pose with which a pod's frames are converted to points in the room.
struct Belief {
    rig: Rig,
    room_from_rig: Pose,
}

fn framed(context: &Context<'_>, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(Body::Torso)?;
    let reference = subject.reference()?;
    let surface = MeshTree::new(&subject.surface);
    let displaced = [SixDof::default(), everywhere(1.0)];
    let scene = subject.on_the_way(&displaced);
    let drawn = Pods::new(&scene, context.seed, &|profile| effort.adapt(profile))?;
    let mut pods = Pods::as_built(&scene, context.seed, &|number, profile, place| {
        effort.adapt(profile);
        as_built(number, profile, place);
    })?;
    let beliefs = beliefs(context, effort, &drawn, &pods)?;
    let mut rows = Vec::new();
    for (case, beliefs) in CASES.iter().zip(&beliefs) {
        for (pod, belief) in pods.all.iter_mut().zip(beliefs) {
            pod.calibrated(&belief.rig)?;
            pod.placed(belief.room_from_rig);
        }
        for pose in displaced.iter().enumerate() {
            rows.push(scanned(&mut pods, (&reference, &surface), pose, case)?);
        }
    }
    Ok(rows)
}

/// Scans pose `k`; returns the tracker's result and the RMS distance of the points from the torso.
fn scanned(
    pods: &mut Pods,
    (reference, surface): (&Reference, &MeshTree),
    (k, truth): (usize, &SixDof),
    case: &str,
) -> Result<Row> {
    let scan = pods.scan(time_ns(k), true)?;
    let fit = track(&pods.measured(&scan, POINTS), reference);
    let back = truth.pose().inverse();
    let [lo, hi] = Region::CHEST;
    let mut near = Vec::new();
    for (pod, decoded) in pods.all.iter().zip(&scan) {
        let points = pod.points(decoded).into_iter().map(|p| back.point(p));
        let inside = points.filter(|p| p.cmpge(lo).all() && p.cmple(hi).all());
        let points: Vec<_> = inside.collect();
        let feet = surface.closest_batch(&points).into_iter().flatten();
        let off = points
            .iter()
            .zip(feet)
            .map(|(p, foot)| foot.point.distance(*p));
        near.extend(off.filter(|off| *off <= NEAR_MM));
    }
    let row = Row::new()
        .text("subject", Body::Torso.name())
        .text("case", case)
        .number("surface_mm", rms(near));
    Ok(answered(row, None, &fit, truth))
}

/// Returns the assumed calibration and pose of each pod, for each case.
fn beliefs(
    context: &Context<'_>,
    effort: Effort,
    drawn: &Pods,
    pods: &Pods,
) -> Result<[Vec<Belief>; CASES.len()]> {
    let mut all: [Vec<Belief>; CASES.len()] = std::array::from_fn(|_| Vec::new());
    for (number, (drawn, pod)) in drawn.all.iter().zip(&pods.all).enumerate() {
        let seed = context
            .seed
            .wrapping_mul(1000)
            .wrapping_add(100 * number as u64);
        let found = calibrated(pod, drawn.rig(), effort.board_poses, seed)?;
        let [hung, located] = [drawn.rig(), &found].map(|rig| at_isocentre(pod, rig, seed));
        let believed = [
            (*drawn.rig(), drawn.room_from_rig()),
            (*drawn.rig(), hung?),
            (found, located?),
            (*pod.rig(), pod.room_from_rig()),
        ];
        for (all, (rig, room_from_rig)) in all.iter_mut().zip(believed) {
            all.push(Belief { rig, room_from_rig });
        }
    }
    Ok(all)
}

/// Returns a pod's profile with the sequence used for boards.
fn for_boards(pod: &Pod) -> Profile {
    let mut profile = pod.profile().clone();
    profile.sequence = Vec::from_iter(profile.calibration_sequence().cloned());
    profile
}

/// Calibrates a pod with a board in many poses, which are planned for the rig as drawn.
fn calibrated(pod: &Pod, drawn: &Rig, count: usize, seed: u64) -> Result<Rig> {
    let profile = for_boards(pod);
    let board = Board::DOTS.scaled(profile.calibration.board_scale.unwrap_or(1.0));
    let wanted = Wanted {
        seed,
        count,
        distance_mm: profile.calibration.distance_mm,
        ..Wanted::default()
    };
    let mut data = Vec::new();
    for (i, pose) in poses(&board, drawn, &wanted)?.iter().enumerate() {
        let name = format!("pose_{i:02}");
        let seen = shown_to(
            &profile,
            &board,
            pose,
            &name,
            seed.wrapping_add(1 + i as u64),
        )?;
        data.extend(seen.ok());
    }
    let [camera_px, projector_px] =
        [&drawn.camera, &drawn.projector].map(|view| [view.lens.width_px, view.lens.height_px]);
    let task = Task {
        board: &board,
        camera_px,
        projector_px,
        nominal: None,
        noise: drawn.noise,
        choice: Choice::default(),
        stop: None,
    };
    let found = calibrate(&task, &data, Vec::new());
    Ok(found
        .map_err(|why| Error::device(why.to_string()))?
        .solution
        .rig)
}

/// Locates a pod with the board at the isocentre, given its assumed rig.
fn at_isocentre(pod: &Pod, rig: &Rig, seed: u64) -> Result<Pose> {
    let mut scene = Scene::load(BOARD_ROOM)?;
    let (position, rotation) = pod.room_from_rig().to_xyz_deg();
    scene.rig = RigPlace {
        position_mm: position,
        rotation_deg: rotation,
    };
    let (object, board) = scene
        .object
        .iter()
        .find_map(|object| match object.shape {
            Shape::Board { board, .. } => Some((object.clone(), board)),
            _ => None,
        })
        .ok_or_else(|| Error::input(BOARD_ROOM, "no board", "a board"))?;
    let data = seen_in(&scene, &for_boards(pod), &board, BOARD_ROOM, seed)?;
    let data = data.map_err(Error::device)?;
    let placed = place(&board, &data, rig).map_err(|why| Error::device(why.to_string()))?;
    Ok(object.scene_from_object() * placed.rig_from_board.inverse())
}

fn of<'a>(rows: &'a Rows, case: &'a str) -> impl Iterator<Item = &'a Row> + Clone {
    part(rows, "frame").filter(move |row| row.get("case") == case)
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut blocks = vec![Block::Words(WORDS.to_owned())];
    if part(rows, "frame").next().is_some() {
        blocks.push(Block::Table(table(rows)));
        blocks.push(Block::Checks(checks(rows)));
    }
    Section::new("Common frame of the pods", blocks)
}

fn table(rows: &Rows) -> Table {
    let mut table = Table::new(
        "acceptance-frame",
        "A torso at its planned place and displaced in all six directions, scanned by pods that \
         are built and mounted with errors: distance of the points of all pods from the true \
         surface (RMS, mm), worst error of the position (mm) and of the angles (degrees), and \
         number of results with a warning, by the calibration and pose that are assumed for the \
         pods.",
        &["pods", "points", "position", "angles", "warnings"],
    );
    for case in CASES {
        let all = of(rows, case);
        table.row([
            case.to_owned(),
            format!(
                "{:.3}",
                worst(all.clone().map(|row| row.value("surface_mm")))
            ),
            format!("{:.3}", worst(all.clone().map(shift_mm))),
            format!("{:.4}", worst(all.clone().map(turn_deg))),
            format!("{} of {}", doubted(all.clone()), all.count()),
        ]);
    }
    table
}

fn checks(rows: &Rows) -> Vec<Check> {
    let by_boards = of(rows, CASES[2]);
    vec![
        Check::at_most(
            "worst position error with pods calibrated and located by boards, in mm",
            worst(by_boards.clone().map(shift_mm)),
            BAR[0],
        ),
        Check::at_most(
            "worst angle error with pods calibrated and located by boards, in degrees",
            worst(by_boards.map(turn_deg)),
            BAR[1],
        ),
    ]
}

/// Returns the worst errors of position (mm) and angles (degrees) with pods that were calibrated and
/// located with boards.
pub(super) fn worst_by_boards(rows: &Rows) -> [f64; 2] {
    let all = of(rows, CASES[2]);
    [worst(all.clone().map(shift_mm)), worst(all.map(turn_deg))]
}
