//! Unusual frames: saturated or dark, of the wrong number or size, or with other images in between.

use crate::decode::patterns::*;
use crate::decode::scene::*;
use phasmid::decode::{Decoded, Decoder, Options, Verdict};
use phasmid::pattern::{Axis, Image, Pattern};

#[test]
fn saturated_and_dark_pixels_are_masked_with_the_reason() {
    let positions = sweep(16);
    let manifest = manifest([equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, true)].concat());
    let bright = Scene {
        floor: 100.0,
        swing: 220.0,
        ..Scene::default()
    };
    let decoded = bright.decode(&manifest, &positions, bright.options());
    let saturated = counts(&decoded)[Verdict::Saturated as usize];
    assert!(
        saturated > positions.len() * 3 / 4,
        "{:?}",
        counts(&decoded)
    );
    let dark = Scene {
        swing: 0.0,
        ..Scene::default()
    };
    let decoded = dark.decode(&manifest, &positions, dark.options());
    assert_eq!(counts(&decoded)[Verdict::Dim as usize], positions.len());
}

#[test]
fn result_does_not_depend_on_thread_count() {
    let positions = sweep(100);
    let scene = Scene::default();
    let patterns = [
        equal(Axis::X, 16.0, 4),
        gray(Axis::X, 8.0, 0..8, true),
        equal(Axis::Y, 64.0, 4),
        equal(Axis::Y, 70.0, 4),
    ];
    let manifest = manifest(patterns.concat());
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| scene.decode(&manifest, &positions, Options::default()))
    });
    let bits = |d: &Decoded| -> Vec<u32> {
        let maps = d
            .axes()
            .flat_map(|(_, m)| m.coordinate.iter().chain(&m.sigma));
        maps.chain(&d.modulation)
            .chain(&d.intensity)
            .map(|v| v.to_bits())
            .collect()
    };
    assert_eq!(bits(&one), bits(&two));
}

#[test]
fn frames_that_do_not_fit_are_refused() {
    let list = [equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, true)].concat();
    let manifest = manifest(list);
    let decoder = Decoder::new(&manifest, 4, 3, None, Options::default()).unwrap();
    let image = |width, height| Image::new(width, height, vec![0_u8; width * height]).unwrap();
    let stack = |n: usize| vec![image(4, 3); n];
    assert!(decoder.decode(&stack(20)).is_ok());
    let error = decoder.decode(&stack(19)).unwrap_err().to_string();
    assert!(
        error.contains("19 frames") && error.contains("20 frames"),
        "{error}"
    );
    assert!(decoder.decode(&vec![image(3, 4); 20]).is_err());
    assert!(decoder.decode(&[]).is_err());
    let mut mixed = stack(20);
    mixed[7] = Image::new(4, 3, vec![0_u16; 12]).unwrap();
    let mut other = stack(20);
    other[7] = image(4, 2);
    let mut holes = stack(20);
    holes[7] = Image::default();
    for wrong in [mixed, other, holes] {
        let error = decoder.decode(&wrong).unwrap_err();
        assert!(error.to_string().contains("frame 7"), "{error}");
    }
}

#[test]
fn images_in_a_sequence_need_no_frame() {
    let positions = sweep(8);
    let scene = Scene::default();
    let list = [equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, true)].concat();
    let plain = manifest(list.clone());
    let mut with_image = list;
    with_image.insert(
        3,
        Pattern::Image {
            file: "speckle.png".into(),
        },
    );
    let frames = scene.frames_u8(&plain, &positions);
    let images = frames.into_iter().map(|f| Image::new(WIDTH, 8, f).unwrap());
    let mut images: Vec<Image> = images.collect();
    images.insert(3, Image::default());
    let decoder = Decoder::new(&manifest(with_image), WIDTH, 8, None, scene.options()).unwrap();
    let decoded = decoder.decode(&images).unwrap();
    let f = figures(&decoded, Axis::X, &positions, 4.0);
    assert!(f.gross == 0.0 && f.coverage > 0.99, "{f:?}");
}
