//! Compares the noise of a measured surface, over repeated scans, with the standard deviation that the
//! decoder states for each pixel and with the bound that the sensor's noise sets.
//!
//! ```sh
//! cargo run --release --example noise_budget
//! ```

use phasmid::{DecodeOptions, Device, Error};

const SCANS: usize = 8;

fn main() -> Result<(), Error> {
    let mut device = Device::builder()
        .profile("webcam-grey")
        .scene("sphere")
        .exact_calibration(true)
        .build()?;
    let rig = device.rig();
    let mut depths: Vec<Vec<f32>> = Vec::new();
    let mut stated = Vec::new();
    let mut bound_mm = 0.0;
    for _ in 0..SCANS {
        let capture = device.scan("quick-4")?;
        let decoding = phasmid::decode(&capture, &rig, &DecodeOptions::default())?;
        bound_mm = phasmid::compare(&decoding, &device.truth()?, &rig)?.bound_mm;
        stated.clone_from(&decoding.maps.depth_sigma);
        depths.push(decoding.maps.depth);
    }
    let (mut noise, mut told, mut pixels) = (0.0, 0.0, 0.0);
    for (at, sigma) in stated.iter().enumerate() {
        let values = depths.iter().map(|depth| f64::from(depth[at]));
        let mean = values.clone().sum::<f64>() / SCANS as f64;
        let squares: f64 = values.map(|z| (z - mean).powi(2)).sum();
        // NaN where one of the scans has no point.
        if mean.is_finite() {
            noise += squares / (SCANS - 1) as f64;
            told += f64::from(*sigma).powi(2);
            pixels += 1.0;
        }
    }
    let (noise, told) = ((noise / pixels).sqrt(), (told / pixels).sqrt());
    println!("noise over {SCANS} scans {noise:.4} mm, stated {told:.4} mm, bound {bound_mm:.4} mm");
    assert!(
        (0.7..1.3).contains(&(noise / told)),
        "the stated sigma is that of the noise"
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
