//! Times decoding with and without an option, alternately. The ratio of the times is the cost of
//! the option and hardly depends on the machine.

use super::cases::lit_all_over;
use phasmid::decode::{Decoded, Held, Known, Options as DecodeOptions, check_sequence};
use phasmid::emulator::render::Options;
use phasmid::error::{Error, Result};
use phasmid::profile::Scene;
use phasmid::profile::{Focus, Profile};
use phasmid::study::scanned::Stage;
use std::hint::black_box;
use std::rc::Rc;

/// Names of the pairs: the option with which decoding is compared to decoding without it.
pub const PAIRS: [&str; 6] = [
    "consistency of single pixels",
    "consistency of pixels and frames",
    "weighted steps",
    "held pixels, corrected",
    "held pixels, smooth prior",
    "held pixels, left out",
];
/// Focus that blurs the projector's pixels on the plane by 0.6 px, and the factor on the profile's
/// exposure. Together they make the error due to held pixels negligible compared with the noise.
const BLURRED: Focus = Focus {
    distance_mm: 700.0,
    aperture_mm: 6.0,
};
const DIM: f64 = 0.2;

/// Decoding to depths without and with an option.
pub struct Pair {
    /// Decodes without the option, and with it.
    pub works: [Box<dyn FnMut()>; 2],
}

/// Creates a pair with a profile like that of the bench of Wu et al., with all pixels lit.
///
/// # Errors
/// Returns an error if the name is unknown or the profile cannot be used.
pub fn pair(name: &str, profile: &Profile) -> Result<Pair> {
    let usual = DecodeOptions::default();
    let [without, with] = match PAIRS.iter().position(|known| *known == name) {
        Some(0 | 1) => [false, true].map(|consistency| DecodeOptions {
            consistency,
            ..usual
        }),
        Some(2) => [false, true].map(|weighted| DecodeOptions { weighted, ..usual }),
        Some(4) => [Held::Off, Held::Smooth].map(|held| DecodeOptions { held, ..usual }),
        Some(_) => [Held::Off, Held::Correct].map(|held| DecodeOptions { held, ..usual }),
        None => return Err(Error::input("pair", name, PAIRS.join(", "))),
    };
    let mut profile = lit_all_over(profile);
    if name == PAIRS[5] {
        profile.projector.focus = Some(BLURRED);
        profile.camera.exposure_us *= DIM;
    }
    let mut stage = Stage::new(&profile, &Scene::load("plane")?, 1, Options::default())?;
    let scanned = Rc::new(stage.scan(0)?);
    let work = |options, checked: bool| -> Result<Box<dyn FnMut()>> {
        let scanned = scanned.clone();
        let decoder = scanned.decoder(options)?;
        decoder.decode(&scanned.images)?;
        let mut out = Decoded::default();
        Ok(Box::new(move || {
            if checked {
                let known = Known::new(false, scanned.calibration.as_ref());
                let _ = black_box(check_sequence(&scanned.manifest, &scanned.images, known));
            }
            // Always `Ok`, since the same images have been decoded before.
            let _ = black_box(decoder.decode_into(&scanned.images, &mut out));
            black_box(&out);
        }))
    };
    Ok(Pair {
        works: [work(without, false)?, work(with, name == PAIRS[1])?],
    })
}
