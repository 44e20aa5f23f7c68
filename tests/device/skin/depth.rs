//! Bias of depth that is measured on skin.

use crate::skin::wall::{PLANE, Seen, bench, is_even, pattern_image, shot, wall};
use glam::{DVec2, DVec3};
use phasmid::emulator::render::Renderer;
use phasmid::pattern::{Axis, Pattern};
use std::f64::consts::TAU;

#[test]
fn oblique_light_biases_depth_as_the_closed_form_says() {
    let profile = bench();
    let skin = "skin = { absorption_per_mm = 0.005, reduced_scattering_per_mm = 1.5 }\n";
    let scene = wall([0.0; 3], &format!("{PLANE}{skin}"));
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let truth = renderer.truth(&[]);
    let (period, steps) = (24.0, 12);
    let frames: Vec<_> = (0..steps)
        .map(|i| {
            let pattern = Pattern::Fringe {
                axis: Axis::X,
                period_px: period,
                phase_rad: TAU * f64::from(i) / f64::from(steps),
            };
            renderer.expected_dn(&shot(&pattern_image(&pattern, &profile)))
        })
        .collect();
    let (baseline, z) = (400.0, 1000.0);
    let focal = 1.433 * 1920.0;
    let (mut count, mut least, mut most) = (0, f64::INFINITY, 0.0f64);
    for i in (0..truth.flags.len())
        .step_by(97)
        .filter(|&i| is_even(&truth, i))
    {
        let x = f64::from(truth.projector_x[i]);
        if !(150.0..1770.0).contains(&x) {
            continue;
        }
        let (mut cos, mut sin) = (0.0, 0.0);
        for (step, frame) in frames.iter().enumerate() {
            let angle = TAU * step as f64 / f64::from(steps);
            cos += f64::from(frame[i]) * angle.cos();
            sin -= f64::from(frame[i]) * angle.sin();
        }
        let turns = sin.atan2(cos) / TAU - x / period;
        let off = (turns - turns.round()) * period;
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let seen = Seen::new(&profile, DVec3::Z, px);
        // Both optical axes point along z, so z = baseline / (X/z - (X - baseline)/z); the second
        // term of the difference is read off the fringe.
        let measured = baseline / (baseline / z - off / focal);
        // On the left of the projector, light travels towards -x under the skin and emerges at a
        // distance s in this direction, so the point appears to be lit by the light that arrives at
        // a distance s before it.
        let to_light = seen.point - DVec3::new(baseline, 0.0, 0.0);
        let s = to_light.x / to_light.length() / 1.4 / (0.35 * 0.005 + 1.5);
        let expected = baseline / (baseline / z + s / z);
        assert!(
            (measured - expected).abs() < 0.01,
            "{px}: {measured} {expected}"
        );
        (least, most) = (least.min(measured - z), most.max(measured - z));
        count += 1;
    }
    println!("{count} pixels, bias {least:.3} to {most:.3} mm");
    assert!(count > 500 && most > 0.2, "{count} {most}");
}
