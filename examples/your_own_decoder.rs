//! Compares your own decoder with the truth. The decoder uses five phase steps of a fine fringe,
//! and unwraps them with five phase steps of a fringe as wide as the projector.
//!
//! ```sh
//! cargo run --release --example your_own_decoder
//! ```

use phasmid::{Capture, Device, Error, Truth};
use std::f64::consts::TAU;

const STEPS: usize = 5;
/// Fine and coarse period in projector pixels; `webcam-grey` has 854 columns.
const PERIODS: [f64; 2] = [32.0, 1024.0];

fn main() -> Result<(), Error> {
    let folder = std::env::temp_dir().join(format!("phasmid-own-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
    let manifest = folder.join("five-steps.toml");
    std::fs::write(&manifest, five_steps()).map_err(|e| Error::io(&manifest, e))?;
    let mut device = Device::builder()
        .profile("webcam-grey")
        .scene("sphere")
        .sequence(&manifest)
        .build()?;
    let capture = device.scan("five-steps")?;
    let x = decode(&capture);
    compare(&x, &device.truth()?);
    std::fs::remove_dir_all(&folder).map_err(|e| Error::io(&folder, e))
}

/// The manifest of the sequence.
fn five_steps() -> String {
    let mut text = "[projector]\nwidth_px = 854\nheight_px = 480\n".to_owned();
    for period in PERIODS {
        for step in 0..STEPS {
            let phase = TAU * step as f64 / STEPS as f64;
            text += &format!(
                "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", period_px = {period}, \
                 phase_rad = {phase:.12} }}\n"
            );
        }
    }
    text
}

/// Returns the projector column that each camera pixel sees; NaN where there is hardly any modulation.
fn decode(capture: &Capture) -> Vec<f64> {
    let phase = |set: usize, at: usize| {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for step in 0..STEPS {
            let level = f64::from(capture.images[set * STEPS + step].value(at));
            let (s, c) = (TAU * step as f64 / STEPS as f64).sin_cos();
            sine -= level * s;
            cosine += level * c;
        }
        let modulation = 2.0 / STEPS as f64 * sine.hypot(cosine);
        let turns = (sine.atan2(cosine) / TAU).rem_euclid(1.0);
        if modulation > 10.0 { turns } else { f64::NAN }
    };
    let pixels = capture.images[0].samples().len();
    let column = |at| {
        let [fine, coarse] = [0, 1].map(|set| phase(set, at) * PERIODS[set]);
        // Choose the order of the fine fringe that is nearest to the coarse position.
        fine + PERIODS[0] * ((coarse - fine) / PERIODS[0]).round()
    };
    (0..pixels).map(column).collect()
}

fn compare(x: &[f64], truth: &Truth) {
    let wanted = Truth::SEEN | Truth::LIT | Truth::SQUARE;
    let smooth = |flags: u8| flags & wanted == wanted && flags & Truth::CREASE == 0;
    let pixels = (0..x.len()).filter(|&at| smooth(truth.flags[at]));
    let errors: Vec<f64> = pixels
        .map(|at| x[at] - f64::from(truth.projector_x[at]))
        .collect();
    let found = errors.iter().filter(|error| error.is_finite()).count();
    let inliers: Vec<f64> = errors.iter().copied().filter(|e| e.abs() < 1.0).collect();
    let rms = (inliers.iter().map(|e| e * e).sum::<f64>() / inliers.len() as f64).sqrt();
    println!(
        "inlier error {rms:.3} projector pixels RMS, {} gross errors, coverage {:.1} %",
        found - inliers.len(),
        100.0 * found as f64 / errors.len() as f64
    );
    assert!(rms < 0.2 && inliers.len() * 100 > 99 * found && found * 10 > errors.len() * 9);
}

#[cfg(test)]
mod tests {
    #[test]
    fn runs() {
        super::main().unwrap();
    }
}
