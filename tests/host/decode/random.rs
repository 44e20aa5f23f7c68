//! Random sequences: valid ones are decoded correctly, and no sequence causes a panic.

use crate::decode::patterns::*;
use crate::decode::scene::*;
use phasmid::decode::{Decoder, Options, Verdict};
use phasmid::pattern::{Axis, Image, Pattern};
use proptest::prelude::*;
use std::f64::consts::TAU;

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 40,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]
    #[test]
    fn random_sequences_decode_without_gross_errors(
        period in 8.5..120.0f64,
        steps in 3usize..10,
        jitter in proptest::collection::vec(-0.3..0.3f64, 10),
        cell_divisor in 1u32..5,
        complements: bool,
        shuffle in any::<u64>(),
        footprint in 0.1..3.0f64,
        seed in 1u64..1000,
    ) {
        let phases: Vec<f64> =
            (0..steps).map(|i| TAU * i as f64 / steps as f64 + jitter[i]).collect();
        let cell = (period / f64::from(cell_divisor + 1)).floor().max(2.0);
        let bits = (1920.0 / cell).log2().ceil() as u32;
        let mut patterns = [
            fringes(Axis::X, period, &phases),
            gray(Axis::X, cell, 0..bits, complements),
            references(),
        ]
        .concat();
        // Frames may come in any order.
        patterns.sort_by_key(|p| uniform(shuffle ^ format!("{p:?}").len() as u64).to_bits());
        let scene = Scene { noise: 0.5, footprint, seed, ..Scene::default() };
        let positions = sweep(8);
        let decoded = scene.decode(&manifest(patterns), &positions, scene.options());
        let f = figures(&decoded, Axis::X, &positions, 0.4 * period);
        prop_assert!(f.gross == 0.0 && f.coverage > 0.98, "{f:?} {:?}", counts(&decoded));
        prop_assert!(f.ratio > 0.85 && f.ratio < 1.15, "{f:?}");
    }
}

fn any_pattern() -> impl Strategy<Value = Pattern> {
    let axis = || prop_oneof![Just(Axis::X), Just(Axis::Y)];
    prop_oneof![
        // Draw from few different values, so that the patterns form sets and codes.
        6 => (axis(), prop_oneof![Just(2.5), Just(16.0), Just(24.0), Just(1e6)], 0u8..6).prop_map(
            |(axis, period_px, step)| Pattern::Fringe {
                axis,
                period_px,
                phase_rad: f64::from(step),
            }
        ),
        3 => (axis(), prop_oneof![Just(1.0), Just(8.0), Just(16.0), Just(1e6)], 0u32..9, any::<bool>())
            .prop_map(|(axis, cell_px, bit, inverted)| Pattern::Gray {
                axis,
                cell_px,
                bits: 9,
                bit,
                inverted,
            }),
        1 => Just(Pattern::White {}),
        1 => Just(Pattern::Black {}),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]
    #[test]
    fn any_sequence_and_frames_do_not_panic(
        patterns in proptest::collection::vec(any_pattern(), 1..40),
        size in prop_oneof![Just((1usize, 1usize)), Just((2, 3)), Just((9, 5))],
        noise in any::<u64>(),
        projector in prop_oneof![Just((1u32, 1u32)), Just((100, 60)), Just((1920, 1080))],
        unwrap_spatial: bool,
    ) {
        let mut manifest = manifest(patterns);
        (manifest.projector.width_px, manifest.projector.height_px) = projector;
        let weighted = noise % 2 == 1;
        let options = Options { unwrap_spatial, weighted, ..Options::default() };
        if let Ok(decoder) = Decoder::new(&manifest, size.0, size.1, None, options) {
            let pixels = size.0 * size.1;
            let frames: Vec<Vec<u16>> = (0..manifest.frame.len() * pixels)
                .map(|i| (uniform(noise.wrapping_add(i as u64)) * 65536.0) as u16)
                .collect::<Vec<_>>()
                .chunks(pixels)
                .map(<[u16]>::to_vec)
                .collect();
            let images: Vec<_> = frames.iter().map(|f| Image::new(size.0, size.1, f.clone()).unwrap()).collect();
            let decoded = decoder.decode(&images).unwrap();
            for (_, map) in decoded.axes() {
                for (v, x) in map.verdict.iter().zip(&map.coordinate) {
                    prop_assert_eq!(*v == Verdict::Valid, x.is_finite());
                }
            }
        }
    }
}
