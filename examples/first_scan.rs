//! Scans an emulated device in memory, decodes the capture and compares the surface with the truth.
//!
//! ```sh
//! cargo run --release --example first_scan
//! ```

use phasmid::{DecodeOptions, Device, Error};

fn main() -> Result<(), Error> {
    let mut device = Device::builder()
        .profile("webcam-grey")
        .scene("sphere")
        .seed(1)
        .build()?;
    let capture = device.scan("quick-4")?;
    let rig = device.factory_calibration()?;
    let decoding = phasmid::decode(&capture, &rig, &DecodeOptions::default())?;
    let score = phasmid::compare(&decoding, &device.truth()?, &device.rig())?;
    println!(
        "{} points: inlier error {:.3} mm RMS, {:.3} % gross errors, coverage {:.1} %",
        score.points,
        score.inlier_rmse_mm,
        100.0 * score.gross_error_rate,
        100.0 * score.coverage
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn runs() {
        super::main().unwrap();
    }
}
