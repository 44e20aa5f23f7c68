//! Fits of synthetic maps with ground truth from a rig and a pose.

use super::case::{Case, rig};
use super::*;
use glam::DVec3;
use phasmid_geometry::Pose;

fn case(board: Board, tilt: DVec3) -> Case {
    let pose = Pose::from_xyz_deg(DVec3::new(20.0, -10.0, 1000.0), tilt);
    Case::new(rig(632.0, [1138, 489]), pose, board)
}

fn dots() -> Case {
    case(Board::DOTS.scaled(4.0), DVec3::new(20.0, -25.0, 12.0))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

#[test]
fn exact_maps_through_two_lenses_are_read_exactly() {
    for case in [
        dots(),
        case(Board::DOTS.scaled(4.0), DVec3::new(-50.0, 20.0, 80.0)),
        case(
            Board::Chess {
                columns: 9,
                rows: 6,
                pitch_mm: 50.0,
            },
            DVec3::new(20.0, 30.0, 0.0),
        ),
    ] {
        let decoded = case.decoded(0.0, 1, |_, _| ());
        let errors = case.errors(&decoded);
        let missing = case
            .seen
            .iter()
            .zip(&errors)
            .filter(|(seen, error)| error.is_none() && case.is_lit(seen.px));
        assert_eq!(missing.count(), 0);
        let found: Vec<_> = errors.iter().flatten().map(|e| e.0.length()).collect();
        let worst = found.iter().copied().fold(0.0, f64::max);
        let all = rms(found.iter().copied());
        println!(
            "{} of {} points: {all:.2e} px RMS, worst {worst:.2e}",
            found.len(),
            errors.len()
        );
        assert!(
            found.len() > 50 && all < 5e-4 && worst < 2e-3,
            "{all} {worst}"
        );
        // Moving the camera pixel changes the projector coordinate according to the slope.
        let fits = local_fits(&case.board, &case.seen, &decoded);
        for (seen, fit) in case.seen.iter().zip(&fits) {
            let Ok(fit) = fit else { continue };
            let off = DVec2::new(0.3, -0.2);
            let (lit, moved) = (fit.at(seen.px), fit.at(seen.px + off));
            assert!((moved.px - case.truth(seen.px + off)).length() < 1.5e-3);
            assert!((moved.px - lit.px - lit.slope * off).length() < 2e-3);
        }
    }
}

/// Errors over their standard deviations have unit variance, and neighbours' errors are
/// independent.
#[test]
fn covariance_matches_scatter_of_noise() {
    let case = dots();
    let (mut whitened, mut beside) = (Vec::new(), Vec::new());
    for seed in 0..6 {
        let errors = case.errors(&case.decoded(1.0, seed, |_, _| ()));
        whitened.extend(errors.iter().flatten().flat_map(|e| e.1.to_array()));
        beside.extend(errors.windows(2).filter_map(|pair| {
            let (a, b) = (pair[0]?, pair[1]?);
            Some(a.1.dot(b.1) / 2.0)
        }));
    }
    let n = whitened.len() as f64;
    let square = whitened.iter().map(|w| w * w).sum::<f64>() / n;
    let mean = whitened.iter().sum::<f64>() / n;
    let correlation = beside.iter().sum::<f64>() / beside.len() as f64;
    println!("{n} errors: mean {mean:.3}, square {square:.3}, correlation {correlation:.3}");
    // Limits of five standard deviations.
    assert!((square - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{square}");
    assert!(mean.abs() < 5.0 / n.sqrt(), "{mean}");
    assert!(correlation.abs() < 5.0 / n.sqrt(), "{correlation}");
    assert!(n > 4500.0, "{n}");
}

/// Every tenth pixel has a wrong fringe order, and pixels on outlines are off by half a pixel.
#[test]
fn wrong_pixels_hardly_change_coordinates() {
    let case = dots();
    let clean = rms(case
        .errors(&case.decoded(1.0, 3, |_, _| ()))
        .iter()
        .flatten()
        .map(|e| e.0.length()));
    let spoilt = case.decoded(1.0, 3, |px, values| {
        if case.past_outline(px).abs() < 1.2 {
            values[0] += 0.5;
            values[1] -= 0.5;
        }
        if (px.x * 7.0 + px.y * 13.0) % 10.0 < 1.0 {
            values[0] += 16.0;
        }
    });
    let wrong = rms(case.errors(&spoilt).iter().flatten().map(|e| e.0.length()));
    println!("clean {clean:.5}, with wrong pixels {wrong:.5} px");
    assert!(wrong < 1.15 * clean, "{wrong} {clean}");
}

/// A noise model with a tenfold error in the variance loses no point, and the fits' covariance
/// still matches their errors.
#[test]
fn standard_deviations_three_times_too_small_cost_no_point() {
    let case = dots();
    let honest = case.errors(&case.decoded(1.0, 4, |_, _| ()));
    let errors = case.errors(&case.decoded(3.2, 4, |_, _| ()));
    for (a, b) in honest.iter().zip(&errors) {
        assert_eq!(a.is_some(), b.is_some());
    }
    let whitened = rms(errors.iter().flatten().flat_map(|e| e.1.to_array()));
    assert!((whitened - 1.0).abs() < 0.1, "{whitened}");
}

#[test]
fn point_not_lit_on_all_sides_has_no_coordinates() {
    let case = dots();
    let edge = 400.0;
    let decoded = case.decoded(1.0, 5, |px, values| {
        if px.x > edge {
            *values = [f64::NAN; 2];
        }
    });
    for (seen, error) in case.seen.iter().zip(case.errors(&decoded)) {
        assert!(seen.px.x < edge || error.is_none(), "{}", seen.px);
        let inside = seen.px.x < edge - 9.0 && case.is_lit(seen.px);
        assert!(!inside || error.is_some(), "{}", seen.px);
    }
}

#[test]
fn incomplete_maps_give_no_coordinates_and_no_panic() {
    let case = dots();
    let whole = case.decoded(1.0, 7, |_, _| ());
    let none = |decoded: &Decoded, seen: &[Seen]| {
        let fits = local_fits(&case.board, seen, decoded);
        assert!(fits.len() == seen.len() && fits.iter().all(Result::is_err));
    };
    none(
        &Decoded {
            y: None,
            ..whole.clone()
        },
        &case.seen,
    );
    none(&Decoded::default(), &case.seen);
    none(
        &Decoded {
            width: 1,
            height: 1,
            ..whole.clone()
        },
        &case.seen,
    );
    none(
        &Decoded {
            width: usize::MAX / 2,
            height: 3,
            ..whole.clone()
        },
        &case.seen,
    );
    none(&whole, &[]);
    none(&whole, &case.seen[..3]);
    let mut wrapped = whole.clone();
    wrapped.x.as_mut().unwrap().wrapped_px = Some(16.0);
    none(&wrapped, &case.seen);
    for bad in [
        DVec2::NAN,
        DVec2::splat(1e300),
        DVec2::splat(-1e9),
        DVec2::ZERO,
    ] {
        let seen: Vec<_> = case.seen.iter().map(|s| Seen { px: bad, ..*s }).collect();
        none(&whole, &seen);
    }
}
