//! Tests with an invented calibration: the page shows the calibration's numbers, and remains
//! well-formed for any data.

use super::*;
use crate::board::{Lit, Sighting};
use crate::rig::{Missed, Unusable};
use crate::solve::{
    Errors, LeftOut, Parameter, PointResidual, PoseSightings, ProjectorResidual, Solution,
    SolvedPose, Unfit,
};
use glam::{DMat2, DVec2, DVec3};
use nalgebra::DMatrix;
use phasmid_geometry::{Board, Pose, Rig, nominal};

/// Approximately standard normal random numbers: sums of twelve uniform ones.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let even = |state: &mut u64| {
            *state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| even(&mut self.0)).sum::<f64>() - 6.0
    }

    fn pair(&mut self) -> DVec2 {
        DVec2::new(self.next(), self.next())
    }
}

const CAMERA_PX: f64 = 0.005;
const PROJECTOR_PX: f64 = 0.03;
/// Derivative of a projector coordinate with respect to the camera point.
const SLOPE: DMat2 = DMat2::from_cols(DVec2::new(4.0, 0.5), DVec2::new(-1.0, 5.0));

fn nominal() -> Rig {
    nominal::rig("pmp-bench")
}

fn errors(lengths: &[f64]) -> Errors {
    let n = lengths.len() as f64;
    Errors {
        count: lengths.len(),
        mean_px: lengths.iter().sum::<f64>() / n,
        rms_px: (lengths.iter().map(|l| l * l).sum::<f64>() / n).sqrt(),
        max_px: lengths.iter().copied().fold(0.0, f64::max),
        whitened_rms: 1.0,
    }
}

fn pose(name: &str, given: usize, noise: &mut Noise) -> (SolvedPose, PoseSightings) {
    let board = Board::DOTS.scaled(4.0);
    let rig = nominal();
    let angle = given as f64 * 2.4;
    let camera_from_board = Pose::from_xyz_deg(
        DVec3::new(
            120.0 * angle.cos(),
            40.0 * angle.sin(),
            1000.0 + 30.0 * angle.sin(),
        ),
        DVec3::new(25.0 * angle.sin(), 25.0 * angle.cos(), 20.0 * angle.sin()),
    );
    let mut sightings = Vec::new();
    let mut points = Vec::new();
    for index in board.indices() {
        let at = camera_from_board.point(board.point(index).extend(0.0));
        let Some(px) = rig.camera.project(at) else {
            continue;
        };
        let lit = rig.projector.project(at);
        let lit = lit.filter(|px| rig.projector.lens.contains(*px));
        let (camera, projector) = (noise.pair(), noise.pair());
        let seen = SLOPE * (CAMERA_PX * camera) + PROJECTOR_PX * projector;
        sightings.push(Sighting {
            index,
            camera_px: px + CAMERA_PX * camera,
            camera_covariance: DMat2::from_diagonal(DVec2::splat(CAMERA_PX * CAMERA_PX)),
            projector: lit.map(|px| Lit {
                px: px + seen,
                slope: SLOPE,
                covariance: DMat2::from_diagonal(DVec2::splat(PROJECTOR_PX * PROJECTOR_PX)),
            }),
        });
        points.push(PointResidual {
            index,
            camera_px: (CAMERA_PX * camera).to_array(),
            camera_whitened: camera.to_array(),
            camera_weight: if index == [3, 3] { 0.0 } else { 1.0 },
            projector: lit.map(|_| ProjectorResidual {
                px: seen.to_array(),
                whitened: projector.to_array(),
                weight: if index == [4, 3] { 0.0 } else { 1.0 },
            }),
        });
    }
    let lengths: Vec<f64> = points
        .iter()
        .map(|p| DVec2::from(p.camera_px).length())
        .collect();
    let lit = points.iter().filter_map(|p| p.projector);
    let lit: Vec<f64> = lit.map(|p| DVec2::from(p.px).length()).collect();
    let solved = SolvedPose {
        name: name.to_owned(),
        given,
        camera_from_board,
        camera_errors: errors(&lengths),
        projector_errors: errors(&lit),
        points,
    };
    let given = PoseSightings {
        name: name.to_owned(),
        sightings,
    };
    (solved, given)
}

fn made_up(names: &[&str]) -> Calibration {
    let mut noise = Noise(7);
    let (poses, sightings): (Vec<SolvedPose>, Vec<PoseSightings>) = names
        .iter()
        .enumerate()
        .map(|(i, name)| pose(name, i, &mut noise))
        .unzip();
    let rig = nominal();
    let mut parameters: Vec<Parameter> = [
        ("camera.fx", rig.camera.lens.focal_px.x),
        ("camera.cx", 0.1),
    ]
    .into_iter()
    .map(|(name, value)| Parameter {
        name: name.to_owned(),
        unit: "px",
        value,
        sigma: 0.02,
    })
    .collect();
    for name in names {
        parameters.extend((0..6).map(|i| Parameter {
            name: format!("{name}.{i}"),
            unit: "mm",
            value: f64::from(i),
            sigma: 0.1,
        }));
    }
    let count = parameters.len();
    let mut covariance = DMatrix::from_fn(count, count, |i, j| if i == j { 0.0004 } else { 0.0 });
    covariance[(0, 1)] = -0.000_38;
    covariance[(1, 0)] = -0.000_38;
    let of = |e: fn(&SolvedPose) -> Errors| poses.first().map_or(Errors::default(), e);
    let solution = Solution {
        rig,
        left_out: vec![LeftOut {
            name: "odd & out".to_owned(),
            given: 99,
            why: Unfit::MirroredProjector,
        }],
        camera_coefficients: [true, true, false, false, false],
        projector_coefficients: [false; 5],
        parameters,
        covariance,
        variance_factor: 1.02,
        inflation: [1.0, 1.5],
        degrees_of_freedom: 1234,
        condition: 1e4,
        camera_errors: of(|p| p.camera_errors),
        projector_errors: of(|p| p.projector_errors),
        warnings: Vec::new(),
        poses,
    };
    Calibration {
        board: Board::DOTS.scaled(4.0),
        solution,
        sightings,
        missed: vec![Missed {
            name: "empty".to_owned(),
            why: Unusable::Invalid("no board: 3 dots; expected 475".to_owned()),
        }],
        rounds: 3,
        largest_bias_px: 0.02,
        last_move_px: 1e-7,
        warnings: vec!["points in 20 of 48 parts of the image < 24".to_owned()],
    }
}

fn about() -> About {
    About {
        made_by: "phasmid calibrate 0".to_owned(),
        remarks: vec![("seed".to_owned(), "1".to_owned())],
        images: vec![("first".to_owned(), "found_first.png".to_owned())],
    }
}

fn html(calibration: &Calibration, about: &About) -> String {
    page::page(calibration, about, &Summary::new(calibration, about))
}

/// Panics unless all elements are properly nested, all attributes are quoted, and every "&" begins
/// one of the references that XML defines.
fn assert_well_formed(text: &str) {
    let mut open: Vec<&str> = Vec::new();
    let body = text.strip_prefix("<!DOCTYPE html>").unwrap();
    for piece in body.split('<').skip(1) {
        let (tag, words) = piece.split_once('>').unwrap_or_else(|| panic!("<{piece}"));
        assert_eq!(tag.matches('"').count() % 2, 0, "<{tag}>");
        assert!(!words.contains('>'), "{words}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split(' ').next().unwrap());
        }
        for after in piece.split('&').skip(1) {
            let known = ["amp;", "lt;", "gt;", "quot;", "#39;"];
            assert!(known.iter().any(|name| after.starts_with(name)), "&{after}");
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn page_is_well_formed_and_self_contained() {
    let text = html(&made_up(&["first", "second", "third"]), &about());
    assert_well_formed(&text);
    for absent in ["<script", "http", "NaN", "inf ", "@import", "url("] {
        assert!(!text.contains(absent), "{absent}");
    }
    for present in [
        "Poses used: 3",
        "0.00",
        "odd &amp; out",
        "no board: 3 dots; expected 475",
        "parts of the image &lt; 24",
        "<td>camera.cx</td><td>-0.9500</td>",
        "href=\"./found_first.png\"",
        "k1 k2",
        "From above",
        "<td>seed</td><td class=\"words\">1</td>",
    ] {
        assert!(text.contains(present), "{present}");
    }
    assert_eq!(text.matches("<svg").count(), 1 + 4 + 1 + 3 + 2);
}

#[test]
fn markup_in_folder_names_is_escaped() {
    let bad = "\"><script>alert('x')</script>&\u{1b}[2J,\n";
    let mut calibration = made_up(&[bad, "b"]);
    calibration.warnings.push(bad.to_owned());
    calibration.missed[0].name = bad.to_owned();
    let about = About {
        made_by: bad.to_owned(),
        remarks: vec![(bad.to_owned(), bad.to_owned())],
        images: vec![(bad.to_owned(), bad.to_owned())],
    };
    let text = html(&calibration, &about);
    assert_well_formed(&text);
    assert!(!text.contains("<script"));
    let screen = Summary::new(&calibration, &about).to_string();
    assert!(!screen.contains('\u{1b}'));
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &calibration, &about).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read(dir.path(), "summary.json")).unwrap();
    assert_eq!(json["left_out"][0]["name"], bad);
    // The quoted name contains the only line break in the table that does not end a row.
    let poses = read(dir.path(), "poses.csv");
    assert!(poses.contains("\"\"\"><script>alert('x')</script>&\u{1b}[2J,\n\","));
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn tables_hold_numbers_at_full_precision() {
    let calibration = made_up(&["first", "second"]);
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &calibration, &about()).unwrap();
    assert!(check_folder(dir.path(), &[], false).is_err());
    let points = read(dir.path(), "points.csv");
    let mut lines = points.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|h| *h == name).unwrap();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let all = calibration.sightings.iter().flat_map(|pose| {
        let name = pose.name.clone();
        pose.sightings.iter().map(move |s| (name.clone(), s))
    });
    let all: Vec<(String, &Sighting)> = all.collect();
    assert_eq!(rows.len(), all.len());
    let residuals = calibration.solution.poses.iter().flat_map(|p| &p.points);
    let mut squares: Vec<f64> = Vec::new();
    for ((row, (name, sighting)), residual) in rows.iter().zip(&all).zip(residuals) {
        assert_eq!(row.len(), head.len());
        assert_eq!(row[0], name);
        let number = |name: &str| row[column(name)].parse::<f64>().unwrap();
        let at = calibration.board.point(sighting.index);
        assert_eq!((number("board_x_mm"), number("board_y_mm")), at.into());
        let px = sighting.camera_px;
        assert_eq!((number("camera_u_px"), number("camera_v_px")), px.into());
        assert!((number("camera_sigma_v_px") - CAMERA_PX).abs() < 1e-12);
        assert_eq!(number("camera_residual_v_px"), residual.camera_px[1]);
        let lit = residual.projector;
        if let Some(lit) = lit {
            // The variance of a coordinate is the projector's own plus the camera's times the
            // squared slopes.
            let own = PROJECTOR_PX * PROJECTOR_PX;
            let sigma = (own + (4.0f64 * 4.0 + 1.0) * CAMERA_PX * CAMERA_PX).sqrt();
            assert!((number("projector_sigma_u_px") - sigma).abs() < 1e-12);
            let sigma = (own + (5.0f64 * 5.0 + 0.25) * CAMERA_PX * CAMERA_PX).sqrt();
            assert!((number("projector_sigma_v_px") - sigma).abs() < 1e-12);
            for axis in ["u", "v"] {
                let of = |what: &str| number(&format!("projector_{what}_{axis}_px"));
                squares.push((of("residual") / of("sigma")).powi(2));
            }
            assert_eq!(number("projector_residual_u_px"), lit.px[0]);
        }
        let outlier = sighting.index == [3, 3] || sighting.index == [4, 3] && lit.is_some();
        assert_eq!(number("weight"), if outlier { 0.0 } else { 1.0 });
        assert_eq!(row.len(), 18);
        match sighting.projector {
            Some(lit) => assert_eq!(number("projector_v_px"), lit.px.y),
            None => assert_eq!(row[column("projector_u_px")], ""),
        }
    }
    // The mean square of the residuals divided by their sigmas is 1, within three sigmas of such a
    // mean.
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    let off = 3.0 * (2.0 / squares.len() as f64).sqrt();
    assert!((mean - 1.0).abs() < off, "{mean} over {}", squares.len());
    let covariance = read(dir.path(), "covariance.csv");
    let cells: Vec<&str> = covariance.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(cells[..3], ["camera.fx", "0.0004", "-0.00038"]);
    assert_eq!(cells.len(), calibration.solution.parameters.len() + 1);
    let rig = Rig::from_toml(&read(dir.path(), "calibration.toml"), "c").unwrap();
    assert_eq!(rig, calibration.solution.rig);
    assert_eq!(read(dir.path(), "poses.csv").lines().count(), 3);
    let json: serde_json::Value = serde_json::from_str(&read(dir.path(), "summary.json")).unwrap();
    let mean = calibration.solution.camera_errors.mean_px;
    assert_eq!(json["camera"]["mean_px"].as_f64(), Some(mean));
    assert_eq!(json["parameters"].as_array().unwrap().len(), 2);
    assert_eq!(json["camera_coefficients"], serde_json::json!(["k1", "k2"]));
}

#[test]
fn bars_show_errors_of_poses() {
    let calibration = made_up(&["first", "second", "third"]);
    let text = html(&calibration, &about());
    for pose in &calibration.solution.poses {
        let told = phasmid_report::plot::figures(pose.camera_errors.mean_px, 4);
        let tip = format!("<title>{}: {told} px</title>", pose.name);
        assert_eq!(text.matches(&tip).count(), 1, "{tip}");
    }
}

#[test]
fn summary_has_counts_seed_and_warnings() {
    let text = Summary::new(&made_up(&["first"]), &about()).to_string();
    for line in [
        "poses: 1 used, 2 left out; a board of 25 x 19 points",
        "seed: 1",
        "variance factor 1.020 over 1234 degrees of freedom; outliers: 2",
        "left out, empty: no board: 3 dots; expected 475",
        "warning: points in 20 of 48 parts of the image < 24",
    ] {
        assert!(text.lines().any(|l| l == line), "{line}\n{text}");
    }
    assert!(
        text.lines()
            .all(|line| line.chars().count() < 100 && line == line.trim_end())
    );
}

#[test]
fn empty_or_invalid_data_does_not_panic() {
    let mut none = made_up(&[]);
    none.solution.parameters.clear();
    none.solution.covariance = DMatrix::zeros(0, 0);
    let mut short = made_up(&["a", "b"]);
    // Tables with inconsistent lengths.
    short.solution.covariance = DMatrix::zeros(1, 1);
    short.sightings.truncate(1);
    short.sightings[0].sightings.truncate(3);
    let mut odd = made_up(&["a"]);
    for pose in &mut odd.solution.poses {
        pose.camera_from_board.translation_mm = DVec3::NAN;
        pose.camera_errors.mean_px = f64::INFINITY;
        for point in &mut pose.points {
            point.camera_px = [f64::NAN; 2];
            point.camera_whitened = [f64::INFINITY; 2];
            point.projector = None;
        }
    }
    odd.sightings[0].sightings[0].camera_px = DVec2::splat(1e300);
    odd.solution.covariance.fill(f64::NAN);
    odd.solution.parameters[0].value = f64::NAN;
    odd.solution.variance_factor = f64::NAN;
    odd.solution.rig.camera.lens.focal_px = DVec2::splat(1e-300);
    odd.solution.rig.camera.lens.width_px = 1;
    odd.solution.rig.projector.lens.height_px = 0;
    odd.solution.rig.projector.rig_from_view.translation_mm = DVec3::INFINITY;
    for calibration in [none, short, odd, made_up(&["only"])] {
        let text = html(&calibration, &About::default());
        assert_well_formed(&text);
        assert!(!text.contains("NaN"));
        let dir = tempfile::tempdir().unwrap();
        let summary = write(dir.path(), &calibration, &About::default()).unwrap();
        assert!(!summary.to_string().contains("NaN"));
    }
}
