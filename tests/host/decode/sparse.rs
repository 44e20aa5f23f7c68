//! Decoding a subset of the pixels, compared with decoding all pixels.

use phasmid::decode::{Decoded, Held, Options, SparseDecoder};
use phasmid::emulator::render;
use phasmid::pattern::Image;
use phasmid::profile::{Profile, Scene};
use phasmid::study::scanned::Stage;

/// For pixels in both results, the points agree to rounding.
#[test]
fn sees_the_same_points_as_a_decoder_of_all_pixels() {
    let mut profile = Profile::load("sgrt-pod").unwrap();
    profile.camera.distortion = [0.02, -0.01, 1e-3, -5e-4, 0.0];
    let mut scene = Scene::load("torso").unwrap();
    for object in &mut scene.object {
        object.position_mm[2] += 1400.0;
    }
    let mut stage = Stage::new(&profile, &scene, 1, render::Options::default()).unwrap();
    let scanned = stage.scan(0).unwrap();
    let size @ [width, _] = Image::common_size(&scanned.images).unwrap();
    // Held pixels are not corrected, because the correction depends on the number of decoded pixels
    // on a smooth surface.
    let options = Options {
        held: Held::State,
        ..Options::default()
    };
    let (_, all) = scanned.decode(options).unwrap();
    for (least, every) in [(1 << 30, 1), (60_000, 2), (30_000, 3), (0, 4)] {
        let rig = scanned.calibration.as_ref();
        let sparse = SparseDecoder::new(&scanned.manifest, size, rig, options, least);
        let sparse = sparse.unwrap();
        assert_eq!(sparse.every(), every);
        let mut out = Decoded::default();
        sparse.decode_into(&scanned.images, &mut out).unwrap();
        assert_eq!(out.width, width.div_ceil(every));
        let (mut both, mut either) = (0, 0);
        for (at, depth) in out.depth.iter().enumerate() {
            let (u, v) = (at % out.width * every, at / out.width * every);
            let whole = all.depth[v * width + u];
            either += usize::from(depth.is_finite() || whole.is_finite());
            if depth.is_finite() && whole.is_finite() {
                both += 1;
                assert!((depth - whole).abs() < 2e-3, "{u} {v}: {depth} {whole}");
            }
        }
        assert!(both > 1000 && both * 10 > either * 9, "{both} of {either}");
    }
}
