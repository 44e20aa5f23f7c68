//! The isolated sensor model, exposed to known signals pixel by pixel.

use super::super::term::{Plan, Term};
use super::Sensor;
use phasmid_profile::Sensor as Parameters;

/// Returns a sensor's output at base gain for given mean signals in digital numbers. Models shot
/// noise, read noise, full well, converter and response, without dark current and fixed-pattern
/// noise. The output has two bytes per pixel, little-endian, if the sensor has more than 8 bits.
/// `seed` and `noise_id` seed the noise as they do for a frame.
pub fn read_out(sensor: &Parameters, [seed, noise_id]: [u64; 2], mean_dn: &[f32]) -> Vec<u8> {
    let mut plan = Plan::default();
    plan.set(Term::Noise, !sensor.noiseless);
    plan.set(Term::CameraResponse, sensor.response.is_bent());
    let chain = Sensor::new(sensor, &plan, (0.0, 0.0), (seed, noise_id), None);
    let (gain, black) = (sensor.gain_dn_per_e, sensor.black_level_dn);
    let mut electrons: Vec<f32> = mean_dn
        .iter()
        .map(|&dn| ((f64::from(dn) - black) / gain).max(0.0) as f32)
        .collect();
    let mut out = vec![0; mean_dn.len() * sensor.native_format().bytes_per_pixel()];
    chain.read(0, &mut electrons, &mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::Profile;

    /// Mean and variance of flat fields match the noise model.
    #[test]
    fn noise_of_flat_fields_matches_the_model() {
        let sensor = Profile::load("pmp-bench").unwrap().camera.sensor;
        let model = sensor.noise_model(0.0, 0.0);
        for (id, mean) in [20.0f32, 90.3, 180.7].into_iter().enumerate() {
            let levels = read_out(&sensor, [1, id as u64], &[mean; 100_000]);
            let n = levels.len() as f64;
            let found = levels.iter().map(|&l| f64::from(l)).sum::<f64>() / n;
            let squares: f64 = levels.iter().map(|&l| (f64::from(l) - found).powi(2)).sum();
            let expected = model.variance_dn2(mean.into());
            assert!((found - f64::from(mean)).abs() < 4.0 * (expected / n).sqrt());
            // The relative standard error of a variance from n values is sqrt(2 / n).
            assert!((squares / n / expected - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
        }
    }
}
