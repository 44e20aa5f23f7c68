//! Poses of boards for the built-in devices.

use super::*;
use crate::nominal;

fn rig(name: &str) -> (Rig, f64) {
    (nominal::rig(name), nominal::board_scale(name))
}

/// Distance from the camera, in millimetres, at which the fields of a device's camera and projector are
/// designed to meet.
fn aimed_mm(name: &str) -> f64 {
    match name {
        // A pod on the ceiling, aimed at the isocentre.
        "sgrt-pod" => 2400.0,
        _ => 1000.0,
    }
}

#[test]
fn boards_cover_the_field_of_every_device() {
    for name in nominal::names() {
        let (rig, scale) = rig(name);
        for (board, seed) in [
            (Board::DOTS.scaled(scale), 0),
            (Board::DOTS.scaled(scale), 7),
        ] {
            let wanted = Wanted {
                seed,
                ..Wanted::default()
            };
            let poses = poses(&board, &rig, &wanted).unwrap();
            assert_eq!(poses.len(), 20);
            let tilt = |pose: &Pose| pose.direction(DVec3::Z).z.acos().to_degrees();
            assert!(poses.iter().all(|p| (14.9..45.1).contains(&tilt(p))));
            let depth = |pose: &Pose| pose.translation_mm.z / aimed_mm(name);
            assert!(
                poses.iter().all(|p| (0.849..1.151).contains(&depth(p))),
                "{name}"
            );
            // Boards are tilted to all four sides.
            let normals: Vec<_> = poses.iter().map(|p| p.direction(DVec3::Z)).collect();
            for side in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y] {
                let many = normals.iter().filter(|n| n.dot(side) > 0.1).count();
                assert!(many >= 4, "{name}: {many} tilted to {side}");
            }
            // Dots cover most cells of the projector's image.
            let lens = &rig.projector.lens;
            let mut cells = [false; 48];
            for pose in &poses {
                for index in board.indices() {
                    let point = pose.point(board.point(index).extend(0.0));
                    if let Some(px) = rig.projector.project(point).filter(|px| lens.contains(*px)) {
                        let column = ((px.x + 0.5) * 8.0 / f64::from(lens.width_px)) as usize;
                        let row = ((px.y + 0.5) * 6.0 / f64::from(lens.height_px)) as usize;
                        cells[(row * 8 + column).min(47)] = true;
                    }
                }
            }
            let covered = cells.iter().filter(|c| **c).count();
            assert!(covered >= 46, "{name}, seed {seed}: {covered} of 48 cells");
        }
    }
}

#[test]
fn poses_depend_on_seed_and_show_whole_chessboards() {
    let (rig, scale) = rig("pmp-bench");
    let board = Board::CHESS;
    let wanted = Wanted {
        seed: 3,
        ..Wanted::default()
    };
    let first = poses(&board, &rig, &wanted).unwrap();
    assert_eq!(first, poses(&board, &rig, &wanted).unwrap());
    for pose in &first {
        for index in board.indices() {
            let point = pose.point(board.point(index).extend(0.0));
            for view in [&rig.camera, &rig.projector] {
                assert!(view.project(point).is_some_and(|px| view.lens.contains(px)));
            }
        }
    }
    let other = Wanted { seed: 4, ..wanted };
    assert_ne!(first, poses(&board, &rig, &other).unwrap());
    // A pose does not depend on the number of poses.
    let more = Wanted {
        count: 40,
        ..wanted
    };
    assert_eq!(first[..], poses(&board, &rig, &more).unwrap()[..20]);
    assert!(poses(&Board::DOTS.scaled(scale), &rig, &more).is_ok());
}

#[test]
fn tilt_is_reduced_where_dots_would_be_too_small() {
    for name in nominal::names() {
        let (rig, scale) = rig(name);
        let board = Board::DOTS.scaled(scale);
        let tilts = |wanted: Wanted| -> Vec<f64> {
            let tilt = |pose: &Pose| pose.direction(DVec3::Z).z.acos().to_degrees();
            let poses = poses(&board, &rig, &wanted).unwrap();
            poses.iter().map(tilt).collect()
        };
        // With this seed, dots are too small in one pose at its drawn tilt.
        let wanted = Wanted {
            seed: 24,
            ..Wanted::default()
        };
        assert!(tilts(wanted).iter().all(|t| (14.9..45.1).contains(t)));
        let steep = tilts(Wanted {
            tilt_deg: [15.0, 60.0],
            ..Wanted::default()
        });
        assert!(steep.iter().all(|t| (14.9..60.1).contains(t)), "{name}");
        let most = steep.iter().copied().fold(0.0, f64::max);
        assert!(most > 40.0, "{name}: {most}");
    }
}

#[test]
fn impossible_poses_are_refused_with_numbers() {
    let (rig, _) = rig("pmp-bench");
    let told = |board: Board, wanted: Wanted| poses(&board, &rig, &wanted).unwrap_err().to_string();
    let words = told(Board::DOTS, Wanted::default());
    for needle in [
        "dots of 2.5 mm",
        " px in their shorter direction",
        "3 px or more",
    ] {
        assert!(words.contains(needle), "{words}");
    }
    let words = told(Board::DOTS.scaled(40.0), Wanted::default());
    assert!(
        words.contains("in the ") && words.contains("board with"),
        "{words}"
    );
    let near = Wanted {
        distance_mm: Some(30.0),
        ..Wanted::default()
    };
    let words = told(Board::DOTS, near);
    assert!(
        words.contains("30 mm away") || words.contains("mm away"),
        "{words}"
    );
    for wanted in [
        Wanted {
            count: 0,
            ..Wanted::default()
        },
        Wanted {
            count: 501,
            ..Wanted::default()
        },
        Wanted {
            distance_mm: Some(f64::NAN),
            ..Wanted::default()
        },
        Wanted {
            tilt_deg: [20.0, 80.0],
            ..Wanted::default()
        },
        Wanted {
            reach: [1.2, 1.0],
            ..Wanted::default()
        },
        Wanted {
            roll_deg: f64::INFINITY,
            ..Wanted::default()
        },
        Wanted {
            least_dot_px: -1.0,
            ..Wanted::default()
        },
    ] {
        let words = told(Board::DOTS.scaled(4.0), wanted);
        assert!(words.contains("; expected "), "{words}");
    }
}

#[test]
fn optical_axes_meet_at_the_aimed_distance() {
    for name in nominal::names() {
        let (rig, _) = rig(name);
        let meeting = rig.meeting_mm().unwrap();
        let off = meeting / aimed_mm(name) - 1.0;
        assert!(off.abs() < 0.02, "{name}: {meeting}");
    }
    // Parallel axes side by side never meet.
    let (mut rig, _) = rig("pmp-bench");
    rig.projector.lens = rig.camera.lens;
    assert_eq!(rig.meeting_mm(), None);
    let filling = filling_mm(&Board::DOTS.scaled(4.0), &rig);
    assert!((100.0..2000.0).contains(&filling), "{filling}");
}

#[test]
fn few_numbers_are_spread_and_many_are_uniform() {
    for seed in 0..20 {
        let drawn: Vec<_> = (0..20).map(|i| numbers(seed, i)).collect();
        for number in 0..NUMBERS {
            let quarter = |q: f64| {
                let inside = |d: &&[f64; NUMBERS]| (q..q + 0.25).contains(&d[number]);
                drawn.iter().filter(inside).count()
            };
            let counts = [0.0, 0.25, 0.5, 0.75].map(quarter);
            assert_eq!(counts.iter().sum::<usize>(), 20);
            assert!(counts.iter().all(|c| (2..=8).contains(c)), "{counts:?}");
        }
    }
    let mean = (0..10_000).map(|i| numbers(3, i)[5]).sum::<f64>() / 10_000.0;
    assert!((mean - 0.5).abs() < 1e-2, "{mean}");
    assert_ne!(numbers(1, 0), numbers(2, 0));
    assert_eq!(numbers(1, 7), numbers(1, 7));
}
