//! Terms of image formation, one by one: a scene that needs the term is rendered with and without it.
//! The error is the difference in phase between the two renderings; the time is the cost of the term in
//! a scan of the sequence's twelve fringes.

use super::frames::LEAST;
use super::needs::{CHECKS, checks, need};
use super::phase::{difference, mm_per_radian, phasors};
use super::rig;
use super::row::times;
use crate::scanned::levels;
use crate::score::depth_bounds;
use crate::timing::Spread;
use glam::DVec2;
use phasmid_core::error::Result;
use phasmid_device::Device;
use phasmid_pattern::Pattern;
use phasmid_profile::{Profile, Scene};
use phasmid_render::{Pass, Term};
use phasmid_render::{Renderer, shot::Shot};
use phasmid_report::lab::{Context, Row, Settings, Trial};

/// Returns one trial per term, except for the footprint along the fringes' axis: a pattern image that
/// varies along x always has it, and `frames` examines it.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    let trial = |term: Term| {
        Trial::new(format!("term/{term}"), settings.seed, move |ctx| {
            run(ctx, term)
        })
        .alone()
    };
    let terms = Term::ALL.into_iter();
    let terms = terms.filter(|term| *term != Term::FootprintX);
    terms.map(trial).collect()
}

fn run(ctx: &Context<'_>, term: Term) -> Result<Vec<Row>> {
    let (size, rounds) = match ctx.settings.quick {
        true => ((120, 160), (3, 0.2)),
        false => ((384, 320), (9, 3.0)),
    };
    let mut scene = Scene::load("torso")?;
    scene.folder = ctx.folder.files();
    if term == Term::AlbedoMaps {
        ctx.folder.leave(CHECKS, &checks()?)?;
    }
    let mut profile = rig::fine(rig::bench(size.0, size.1)?);
    let rows = Profile::load("pmp-bench")?.camera.height_px;
    need(term, &mut profile, &mut scene);
    // A sensor with fewer rows gets a longer line time, so that its total read-out time is unchanged.
    profile.camera.line_time_us *= f64::from(rows) / f64::from(size.1);
    // Switch noise on only to test its own term; in other trials it would hide the difference.
    profile.camera.sensor.noiseless = term != Term::Noise;
    let device = Device::builder(&profile, &scene).seed(ctx.seed).build()?;
    let sequence = device.shots();
    let mut renderer = device.renderer;
    let truth = renderer.truth(&sequence);
    let (rig, manifest) = (
        profile.nominal_rig(),
        profile.manifest(&profile.sequence[0]),
    );
    let mm = mm_per_radian(&rig, &truth);
    let fringes = sequence.into_iter();
    let fringes = fringes.filter(|(pattern, _)| matches!(pattern, Pattern::Fringe { .. }));
    // Each exposure has its own noise.
    let shots: Vec<Shot> = (0..)
        .zip(fringes)
        .map(|(noise_id, (_, shot))| Shot { noise_id, ..shot })
        .collect();
    let watch = ctx.stopwatch();
    let mut seconds = [Vec::new(), Vec::new()];
    let mut found: [Vec<DVec2>; 2] = [Vec::new(), Vec::new()];
    for _ in watch.rounds(rounds.0, rounds.1) {
        for (place, included) in [false, true].into_iter().enumerate() {
            renderer.force(term, included);
            if found[place].is_empty() {
                found[place] = phasors(&scan(&mut renderer, &shots)?);
            } else {
                renderer.make_ready(&shots);
            }
            renderer.invalidate();
            seconds[place].push(watch.seconds(|| {
                for shot in &shots {
                    std::hint::black_box(renderer.expose(shot));
                }
            }));
        }
    }
    let off = difference(&found[0], &found[1], &mm, LEAST);
    let of_bound = match term {
        Term::Noise => over_bound(&found, &mm, &depth_bounds(&truth, &manifest, &rig)),
        _ => f64::NAN,
    };
    let pass = match term.pass() {
        Pass::Geometry => "geometry",
        Pass::Exposure => "exposure",
        Pass::Sensor => "sensor",
    };
    let per_pixel = 1e9 / renderer.pixel_count() as f64;
    let [without, with] = seconds.map(|all| Spread::new(all).times(per_pixel));
    let row = Row::new()
        .text("group", "term")
        .text("setting", &term.to_string())
        .text("pass", pass)
        .number("frames", shots.len() as f64)
        .number("inlier_rmse_mm", off.inlier_rmse_mm)
        .number("ratio_to_bound", of_bound)
        .number("gross", off.gross)
        .number("coverage", off.coverage);
    let row = times(row, "ns", with);
    Ok(vec![times(row, "without_ns", without)])
}

/// Returns the root mean square over pixels of the difference of two phases, as depth relative to each
/// pixel's bound.
fn over_bound(found: &[Vec<DVec2>; 2], mm_per_radian: &[f64], bounds: &[f64]) -> f64 {
    let pairs = found[0]
        .iter()
        .zip(&found[1])
        .zip(mm_per_radian)
        .zip(bounds);
    let seen =
        pairs.filter(|(((a, b), _), bound)| a.length().min(b.length()) >= LEAST && **bound > 0.0);
    let squares: Vec<f64> = seen
        .map(|(((a, b), mm), bound)| (a.angle_to(*b) * mm / bound).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn scan(renderer: &mut Renderer, shots: &[Shot]) -> Result<Vec<Vec<f64>>> {
    let frames = shots.iter().map(|shot| levels(renderer.expose(shot)));
    frames.collect()
}
