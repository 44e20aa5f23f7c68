//! A calibration from twenty poses of the paper's board of dots, and a scan with the resulting rig.

use super::bench::{around_trapezoid, bench, surface, trapezoid};
use super::figures::{Target, of, three};
use super::published::REPROJECTION_PX;
use super::scan::Scan;
use crate::boards::shown_to;
use crate::calibration::Truth;
use phasmid_calibrate::rig::{Calibration, Missed, Task, Unusable, calibrate};
use phasmid_calibrate::solve::Choice;
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Decoder, Options};
use phasmid_geometry::board_poses::{Wanted, poses};
use phasmid_geometry::{Board, Pose, Rig};
use phasmid_profile::Profile;
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_report::plot::figures;

/// Number of poses in the complete form of the study, as in Wu et al., then in its quick form.
const POSES: usize = 20;
const QUICK_POSES: usize = 5;

const WITH_TRUTH: &str = "true rig";
const WITH_ESTIMATE: &str = "calibrated rig";

/// Returns a single trial, because the solver needs all poses.
pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    vec![Trial::new("calibration", settings.seed, calibration)]
}

fn calibration(context: &Context<'_>) -> Result<Vec<Row>> {
    let quick = context.settings.quick;
    let mut profile = Profile::load("pmp-bench")?;
    let sequence = profile.calibration_sequence().cloned();
    profile.sequence = Vec::from_iter(sequence);
    let rig = profile.nominal_rig();
    let board = Board::DOTS.scaled(profile.calibration.board_scale.unwrap_or(1.0));
    let wanted = Wanted {
        seed: context.seed,
        count: if quick { QUICK_POSES } else { POSES },
        ..Wanted::default()
    };
    let shown = poses(&board, &rig, &wanted)?;
    let (mut seen, mut places, mut missed) = (Vec::new(), Vec::new(), Vec::new());
    for (i, pose) in shown.iter().enumerate() {
        let name = format!("pose_{i:02}");
        let seed = context.seed.wrapping_mul(1000).wrapping_add(i as u64);
        match shown_to(&profile, &board, pose, &name, seed)? {
            Ok(data) => {
                seen.push(data);
                places.push(*pose);
            }
            Err(why) => missed.push(Missed {
                name,
                why: Unusable::NoBoard {
                    why,
                    saturated: 0.0,
                },
            }),
        }
    }
    let [camera_px, projector_px] =
        [&rig.camera, &rig.projector].map(|view| [view.lens.width_px, view.lens.height_px]);
    let task = Task {
        board: &board,
        camera_px,
        projector_px,
        nominal: Some(&rig),
        noise: rig.noise,
        choice: Choice::default(),
        stop: None,
    };
    let found = calibrate(&task, &seen, missed).map_err(|why| Error::device(why.to_string()))?;
    let mut rows = vec![solved(&found, &rig, &places)];
    rows.extend(scans(context, &found.solution.rig)?);
    Ok(rows)
}

/// Returns a row with the errors of the calibration against the truth.
fn solved(found: &Calibration, rig: &Rig, shown: &[Pose]) -> Row {
    let solution = &found.solution;
    let truth = Truth::new(solution, rig, shown);
    let (mut squares, mut points) = (0.0, 0.0);
    for solved in &solution.poses {
        for sighting in &found.sightings[solved.given].sightings {
            let point = shown[solved.given].point(found.board.point(sighting.index).extend(0.0));
            if let Some(px) = rig.camera.project(point) {
                squares += (sighting.camera_px - px).length_squared();
                points += 1.0;
            }
        }
    }
    let error = |name: &str| {
        let found = truth.parameters.iter().find(|p| p.name == name);
        found.map_or(f64::NAN, |p| p.error)
    };
    Row::new()
        .text("case", "solution")
        .number("poses", solution.poses.len() as f64)
        .number("points", points)
        .number("camera_px", solution.camera_errors.mean_px)
        .number("projector_px", solution.projector_errors.mean_px)
        .number("dots_px", f64::sqrt(squares / points))
        .number("mahalanobis_squared", truth.mahalanobis_squared)
        .number("bound_99", truth.bound_99)
        .number("camera_focal_px", rig.camera.lens.focal_px.x)
        .number("camera_focal_error_px", error("camera.fx"))
        .number("projector_focal_px", rig.projector.lens.focal_px.x)
        .number("projector_focal_error_px", error("projector.fx"))
        .number("baseline_error_mm", error("projector.x"))
        .number("warnings", found.warnings.len() as f64)
}

/// Scans the trapezoid at 1000 mm, and decodes it with the true rig and with the calibrated one.
fn scans(context: &Context<'_>, found: &Rig) -> Result<[Row; 2]> {
    let profile = bench(1.0, around_trapezoid(context.settings.quick))?;
    let scene = trapezoid(1000.0)?;
    let scan = Scan::new(&profile, &scene, context.seed)?;
    let target = Target::new(&surface(&scene)?, scan.rig(), &scan.truth);
    // If the camera is cut, adapt the calibrated lens to the smaller image.
    let mut rig = *found;
    let whole = Profile::load("pmp-bench")?.nominal_rig().camera.lens;
    let cut = &scan.rig().camera.lens;
    rig.camera.lens.principal_px -= whole.principal_px - cut.principal_px;
    (rig.camera.lens.width_px, rig.camera.lens.height_px) = (cut.width_px, cut.height_px);
    let (width, height) = scan.size();
    let decoder = Decoder::new(
        &scan.scanned.manifest,
        width,
        height,
        Some(&rig),
        Options::default(),
    )?;
    let estimate = decoder.decode(&scan.scanned.images)?;
    let row = |case: &str, depth: &[f32]| -> Result<Row> {
        let figures = target.figures(depth, None, &scan.truth)?;
        Ok(figures.row(Row::new().text("case", case)))
    };
    Ok([
        row(WITH_TRUTH, &scan.decoded.depth)?,
        row(WITH_ESTIMATE, &estimate.depth)?,
    ])
}

/// Returns tables and checks.
pub(super) fn section(rows: &Rows) -> Section {
    let with = |case: &'static str| of(rows, "calibration").find(move |r| r.get("case") == case);
    let solution = with("solution");
    let value = |column: &str| solution.map_or(f64::NAN, |row| row.value(column));
    let mut table = Table::new(
        "paper-calibration",
        format!(
            "Calibration from {} poses of a board of 475 dots.",
            value("poses")
        ),
        &["quantity", "paper", "ours"],
    );
    let [camera, projector] = REPROJECTION_PX;
    for (name, paper, ours) in [
        (
            "mean reprojection error, camera, px",
            three(camera),
            three(value("camera_px")),
        ),
        (
            "mean reprojection error, projector, px",
            three(projector),
            three(value("projector_px")),
        ),
        (
            "error of the dots, RMS, px",
            String::new(),
            three(value("dots_px")),
        ),
        (
            "error of the focal length, camera, px",
            String::new(),
            focal(value("camera_focal_error_px"), value("camera_focal_px")),
        ),
        (
            "error of the focal length, projector, px",
            String::new(),
            focal(
                value("projector_focal_error_px"),
                value("projector_focal_px"),
            ),
        ),
        (
            "error of the baseline, mm",
            String::new(),
            three(value("baseline_error_mm")),
        ),
        (
            "squared Mahalanobis distance from the truth (its 99 % bound)",
            String::new(),
            format!(
                "{} ({})",
                three(value("mahalanobis_squared")),
                three(value("bound_99"))
            ),
        ),
    ] {
        table.row([name.to_owned(), paper, ours]);
    }
    for case in [WITH_TRUTH, WITH_ESTIMATE] {
        let mae = with(case).map_or(f64::NAN, |row| row.value("mae_mm"));
        let name = format!("MAE of the trapezoid at 1000 mm with the {case}, mm");
        table.row([name, String::new(), three(mae)]);
    }
    let checks = [("camera", camera), ("projector", projector)].map(|(name, paper)| {
        let found = value(&format!("{name}_px"));
        Check::at_most(
            format!("mean reprojection error of the {name} in px"),
            found,
            paper,
        )
    });
    Section::new(
        "Calibration",
        vec![
            Block::Words(WORDS.to_owned()),
            Block::Table(table),
            Block::Checks(checks.into()),
        ],
    )
}

/// Formats a difference and its reference value. The difference has two figures, because further digits
/// differ between machines.
fn focal(error: f64, of: f64) -> String {
    format!("{} of {}", figures(error, 2), figures(of, 4))
}

const WORDS: &str = "The board is the paper's, with dots of 2.5 mm and markers of 5 mm, at four \
    times its size: at 1000 mm the paper's own dots would be 1.6 pixels wide. All parameters are \
    estimated, distortion only where the data require it. Here the lenses are sharp at all \
    distances.";
