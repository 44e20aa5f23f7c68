//! Decoding of different pattern sequences.

use phasmid::pattern::{Axis, Manifest, ManifestFrame, Pattern, ProjectorSize};
use std::f64::consts::TAU;

pub fn fringes(axis: Axis, period_px: f64, phases: &[f64]) -> Vec<Pattern> {
    phases
        .iter()
        .map(|&phase_rad| Pattern::Fringe {
            axis,
            period_px,
            phase_rad,
        })
        .collect()
}

pub fn equal(axis: Axis, period_px: f64, n: usize) -> Vec<Pattern> {
    let phases: Vec<f64> = (0..n).map(|i| TAU * i as f64 / n as f64).collect();
    fringes(axis, period_px, &phases)
}

pub fn gray(
    axis: Axis,
    cell_px: f64,
    bits: std::ops::Range<u32>,
    complements: bool,
) -> Vec<Pattern> {
    let all = bits.end;
    bits.rev()
        .flat_map(|bit| {
            [false, true]
                .into_iter()
                .take(1 + usize::from(complements))
                .map(move |inverted| Pattern::Gray {
                    axis,
                    cell_px,
                    bits: all,
                    bit,
                    inverted,
                })
        })
        .collect()
}

pub fn references() -> Vec<Pattern> {
    vec![Pattern::White {}, Pattern::Black {}]
}

pub fn manifest(patterns: Vec<Pattern>) -> Manifest {
    Manifest {
        projector: ProjectorSize {
            width_px: 1920,
            height_px: 1080,
        },
        frame: patterns
            .into_iter()
            .map(|pattern| ManifestFrame {
                file: None,
                pattern,
            })
            .collect(),
    }
}
