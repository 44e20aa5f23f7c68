//! Complete scans with noise: benefit and cost of steps, resolution and samples per pixel.

use super::held::depth_bias;
use super::rig::{self, PERIOD_PX};
use super::row::times;
use crate::scanned::{Stage, scored};
use crate::score::{depth_bounds, depth_errors};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Decoded, Held, Options};
use phasmid_measure::GROSS_MM;
use phasmid_profile::Scene;
use phasmid_render::{self as render, truth::Truth};
use phasmid_report::lab::{Context, Row, Settings, Trial};

/// One setting.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Case {
    steps: usize,
    /// Camera pixels per side, relative to the bench's.
    scale: f64,
    samples: u32,
}

/// Returns the settings: each number of steps at each resolution, and each number of samples at twelve
/// steps.
fn cases(quick: bool) -> Vec<Case> {
    let (steps, scales): (&[usize], &[f64]) = match quick {
        true => (&[3, 6, 12, 24], &[0.5, 1.0]),
        false => (
            &[3, 4, 6, 8, 12, 16, 24, 32, 48],
            &[0.5, 0.75, 1.0, 1.5, 2.0],
        ),
    };
    let grid = scales.iter().flat_map(|&scale| {
        let of = move |&steps| Case {
            steps,
            scale,
            samples: 1,
        };
        steps.iter().map(of)
    });
    let sampled = [4, 16, 64].map(|samples| Case {
        steps: 12,
        scale: 1.0,
        samples,
    });
    grid.chain(sampled).collect()
}

/// Returns one trial per setting.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    let trial = |case: Case| {
        let Case {
            steps,
            scale,
            samples,
        } = case;
        let key = format!("scan/steps={steps}/scale={scale}/samples={samples}");
        Trial::new(key, settings.seed, move |ctx| run(ctx, case)).alone()
    };
    cases(settings.quick).into_iter().map(trial).collect()
}

fn run(ctx: &Context<'_>, case: Case) -> Result<Vec<Row>> {
    let (size, rounds) = match ctx.settings.quick {
        true => ((160, 112), (3, 0.3)),
        false => ((384, 224), (9, 4.0)),
    };
    let profile = rig::with_steps(rig::bench(size.0, size.1)?, case.steps);
    let profile = rig::scaled(profile, case.scale);
    let scene = Scene::load("trapezoid")?;
    let options = render::Options {
        samples: case.samples,
        ..render::Options::default()
    };
    let mut stage = Stage::new(&profile, &scene, ctx.seed, options)?;
    // The first scan computes the tables of pattern images, which a device does only once.
    let scanned = stage.scan(0)?;
    let rig = profile.nominal_rig();
    let watch = ctx.stopwatch();
    let rendering = watch.spread(rounds.0, rounds.1, || {
        stage.renderer().invalidate();
        let _ = std::hint::black_box(stage.scan(0));
    });
    let decoder = scanned.decoder(Options::default())?;
    let mut failed = None;
    let decoding = watch.spread(rounds.0, rounds.1, || {
        failed = std::hint::black_box(decoder.decode(&scanned.images)).err();
    });
    if let Some(e) = failed {
        return Err(Error::device(e));
    }
    let truth = stage.truth();
    let (_, score) = scored(&scanned, &truth)?;
    let bias = depth_bias(&profile, &scene, &rig, &truth, PERIOD_PX)?;
    let (_, uncorrected) = scanned.decode(Options {
        held: Held::State,
        ..Options::default()
    })?;
    let bounds = depth_bounds(&truth, &scanned.manifest, &rig);
    let (held_mm, ratio_less_held) = less_bias(&bounds, &uncorrected, &truth, &bias);
    let row = Row::new()
        .text("group", "scan")
        .number("steps", case.steps as f64)
        .number("scale", case.scale)
        .number("samples", f64::from(case.samples))
        .number("width", f64::from(profile.camera.width_px))
        .number("height", f64::from(profile.camera.height_px))
        .number("frames", scanned.images.len() as f64)
        .number("points", score.points as f64)
        .number("inlier_rmse_mm", score.inlier_rmse_mm)
        .number("crease_rmse_mm", score.crease.inlier_rmse_mm)
        .number("bound_mm", score.bound_mm)
        .number("ratio_to_bound", score.ratio_to_bound)
        .number("held_mm", held_mm)
        .number("ratio_less_held", ratio_less_held)
        .number("gross", score.gross_error_rate)
        .number("beyond_5_sigma", score.stated.beyond_5_sigma)
        .number("coverage", score.coverage);
    let row = times(row, "render_s", rendering);
    Ok(vec![times(row, "decode_s", decoding)])
}

/// Returns two root mean squares over the inliers on smooth surfaces: the first of the known bias in mm,
/// the second of the ratio of (uncorrected error minus bias) to the pixel's bound.
fn less_bias(bounds: &[f64], decoded: &Decoded, truth: &Truth, bias: &[f64]) -> (f64, f64) {
    let errors = depth_errors(decoded, truth);
    let (mut count, mut squares, mut ratios) = (0.0, 0.0, 0.0);
    for ((error, bias), bound) in errors.iter().zip(bias).zip(bounds) {
        let error = f64::from(*error);
        if error.abs() <= GROSS_MM && bias.is_finite() && *bound > 0.0 {
            count += 1.0;
            squares += bias * bias;
            ratios += ((error - bias) / bound).powi(2);
        }
    }
    ((squares / count).sqrt(), (ratios / count).sqrt())
}
