//! Tests that both instruction sets decode a row identically.

use super::*;
use crate::options::Options;
use crate::phase::RowNoise;
use crate::plan::Plan;
use crate::robust_scale::RobustScale;
use phasmid_geometry::NoiseModel;
use phasmid_pattern::Manifest;

/// Coordinate, sigma, verdict, modulation and intensity of a row.
type Row = (Vec<u32>, Vec<u32>, Vec<Verdict>, Vec<u32>, Vec<u32>);

#[test]
fn both_instruction_sets_give_the_same_bits() {
    both_ways([5, 4], false);
    both_ways([3, 4], false);
    both_ways([8, 6], true);
}

fn both_ways(steps: [u32; 2], weighted: bool) {
    let mut text = "[projector]\nwidth_px = 500\nheight_px = 300\n".to_owned();
    for (period, steps) in [23.7, 31.0].into_iter().zip(steps) {
        for i in 0..steps {
            let phase = f64::from(i) * std::f64::consts::TAU / f64::from(steps);
            text += &format!(
                "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", \
                 period_px = {period}, phase_rad = {phase} }}\n"
            );
        }
    }
    for bit in 0..5 {
        text += &format!(
            "[[frame]]\npattern = {{ kind = \"gray\", axis = \"x\", cell_px = 20, bits = 5, \
             bit = {bit} }}\n"
        );
    }
    let manifest = Manifest::parse(&text, "t").unwrap();
    let plan = Plan::new(&manifest).unwrap();
    let options = Options {
        weighted,
        ..Options::default()
    };
    let kernels = [AxisKernel::new(&plan.axes[0], false, &options)];
    let width = 203;
    // A ramp of fringes, followed by unstructured samples.
    let frames: Vec<Vec<u8>> = manifest
        .frame
        .iter()
        .map(|f| {
            let level = |u: u32| match f.pattern.level(2 * u) {
                Some(level) if u < 180 => 30.0 + 160.0 * level,
                _ => f64::from(u * 7919 % 13),
            };
            (0..width as u32).map(|u| level(u).round() as u8).collect()
        })
        .collect();
    let frames: Vec<&[u8]> = frames.iter().map(Vec::as_slice).collect();
    let noise = NoiseModel {
        gain_dn_per_e: 0.02,
        read_noise_dn: 0.7,
        black_level_dn: 3.0,
        saturation_dn: 255.0,
    };
    let job = Job {
        frames: &frames,
        kernels: &kernels,
        robust_scale: &[vec![RobustScale::default(); 2]],
        references: None,
        unused_bits: [0; 2],
        noise: RowNoise::new(&noise),
        saturation: 255.0,
        range: 252.0,
        min_modulation: 2.0,
        min_contrast: 0.25,
        max_phase_sigma: 0.15,
        width,
    };
    let run = |dispatched: bool| -> Row {
        let mut maps = [(); 4].map(|()| vec![0.0f32; width]);
        let mut verdict = vec![Verdict::Valid; width];
        let [coordinate, sigma, modulation, intensity] = &mut maps;
        let out = AxisOut {
            coordinate,
            sigma,
            verdict: &mut verdict,
        };
        let (scratch, outs) = (&mut Scratch::default(), [Some(out), None]);
        if dispatched {
            decode_row(&job, 0, scratch, outs, modulation, intensity);
        } else {
            decode_body(&job, 0, scratch, outs, modulation, intensity);
        }
        let [c, s, m, i] = maps.map(|map| map.iter().map(|v| v.to_bits()).collect());
        (c, s, verdict, m, i)
    };
    let (fast, plain) = (run(true), run(false));
    assert!(fast == plain);
    let valid = fast.2.iter().filter(|v| **v == Verdict::Valid).count();
    assert!((150..=180).contains(&valid), "{valid}");
}
