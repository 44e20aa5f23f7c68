//! Exposures over seven decades: the signal, and its noise.

use super::case::{Case, Group, Sweep};
use super::light::duration;
use super::rays::EPS_F32;
use super::scenes::{scene, small};
use crate::scanned::levels;
use phasmid_core::error::Result;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::PixelFormat;
use phasmid_render::Renderer;
use phasmid_render::{pattern_image::PatternImage, shot::Shot};
use phasmid_report::lab::Context;
use std::sync::Arc;

/// Maximum error of an estimate in standard deviations; chance exceeds it once in some 16000 estimates.
pub(super) const SURE: f64 = 4.0;

pub(super) const GROUP: Group = Group {
    title: "Exposures",
    sweeps: &[
        Sweep {
            key: "exposures",
            title: "A white plane exposed for 1 us to 10 s",
            oracle: "The signal grows with the exposure, up to the full well and the converter's \
                largest value. Allowed: 16 roundings of f32 of the signal. Pixels beyond the full \
                well have to reach the value from which the decoder treats them as saturated",
            ratio: "exposure in us",
            error: "worst error in DN",
            rounding: false,
            cases: |_| signal(),
        },
        Sweep {
            key: "shot-noise",
            title: "Noise of these exposures under faint light, 16-bit sensor with 4 DN per \
                electron, read noise 2 e",
            oracle: "Variance by EMVA 1288: gain^2 read^2 + 1/12 + gain (mean - black). Allowed: 4 \
                standard deviations of an estimated variance, from the third and fourth moments of \
                the Poisson distribution",
            ratio: "electrons",
            error: "relative error of the variance",
            rounding: false,
            cases: noise,
        },
    ],
};

const EXPOSURES_NS: [u64; 8] = [
    1_000,
    10_000,
    100_000,
    1_000_000,
    10_000_000,
    100_000_000,
    1_000_000_000,
    10_000_000_000,
];

/// Returns a plane that fills the view.
pub(super) fn white_plane(more: &str) -> Result<Scene> {
    scene(&format!(
        "{more}[[object]]\nshape = {{ kind = \"plane\" }}\nalbedo = 0.5\nposition_mm = [0, 0, 1000]\n"
    ))
}

pub(super) fn white(exposure_ns: u64, noise_id: u64) -> Shot {
    Shot {
        id: noise_id,
        noise_id,
        pattern_image: Some(Arc::new(PatternImage::Uniform(255))),
        light: 1.0,
        exposure_ns,
        ..Shot::default()
    }
}

fn signal() -> Result<Vec<Case>> {
    let mut profile = small()?;
    profile.camera.sensor.noiseless = true;
    let sensor = profile.camera.sensor.clone();
    let mut renderer = Renderer::new(&profile, &white_plane("")?, 1)?;
    let base_ns = 1_000_000;
    let base = renderer.expected_dn(&white(base_ns, 0));
    let top = (sensor.full_well_e * sensor.gain_dn_per_e + sensor.black_level_dn)
        .min(sensor.full_scale_dn());
    let one = |exposure_ns: u64| {
        let found = renderer.expected_dn(&white(exposure_ns, 0));
        let times = exposure_ns as f64 / base_ns as f64;
        let (mut worst, mut below) = (0.0_f64, 0);
        for (found, base) in found.iter().zip(&base) {
            let exact = sensor.black_level_dn + (f64::from(*base) - sensor.black_level_dn) * times;
            below += usize::from(exact < top);
            worst = worst.max((f64::from(*found) - exact.min(top)).abs());
        }
        // The rounding error of the base grows with the exposure, up to saturation.
        let largest = found.iter().fold(0.0_f32, |m, v| m.max(*v));
        let allowed =
            16.0 * EPS_F32 * (f64::from(largest) + sensor.black_level_dn * times.min(30.0));
        let (name, ratio) = (duration(exposure_ns as f64), exposure_ns as f64 * 1e-3);
        let share = below as f64 / found.len() as f64;
        let told = sensor
            .noise_model(0.0, exposure_ns as f64 * 1e-9)
            .saturation_dn;
        let full = found
            .iter()
            .filter(|dn| f64::from(dn.round()) >= told)
            .count();
        if full + below < found.len() {
            let says = format!("{full} pixels at {told} DN or more");
            return Case::failed(name, ratio, &says);
        }
        let case = Case::held(name, ratio, worst, allowed).kept(share, 0.0);
        if share < 1.0 {
            case.says(format!("saturated from {told} DN"))
        } else {
            case
        }
    };
    Ok(EXPOSURES_NS.into_iter().map(one).collect())
}

/// Returns a profile with a 16-bit sensor that rounds to a quarter of an electron.
pub(super) fn fine() -> Result<Profile> {
    let mut profile = small()?;
    profile.camera.format = PixelFormat::Y16;
    let sensor = &mut profile.camera.sensor;
    sensor.bits = 16;
    sensor.gain_dn_per_e = 4.0;
    sensor.black_level_dn = 200.0;
    sensor.read_noise_e = 2.0;
    sensor.full_well_e = 15_000.0;
    Ok(profile)
}

fn noise(context: &Context<'_>) -> Result<Vec<Case>> {
    let profile = fine()?;
    let sensor = profile.camera.sensor.clone();
    let frames = if context.settings.quick { 12 } else { 100 };
    let mut quiet_profile = profile.clone();
    quiet_profile.camera.sensor.noiseless = true;
    let scene = white_plane("")?;
    let mut quiet = Renderer::new(&quiet_profile, &scene, 1)?;
    let mut renderer = Renderer::new(&profile, &scene, context.seed)?;
    let (gain, black) = (sensor.gain_dn_per_e, sensor.black_level_dn);
    let mut cases = Vec::new();
    for (k, exposure_ns) in EXPOSURES_NS.into_iter().enumerate() {
        let faint = |id: u64| Shot {
            light: 1e-4,
            ..white(exposure_ns, id)
        };
        let mean = quiet.expected_dn(&faint(0));
        let (mut sum, mut expected, mut spread, mut light, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for turn in 0..frames {
            let frame = renderer.expose(&faint((k * 1000 + turn) as u64));
            for (dn, mean) in levels(frame)?.into_iter().zip(&mean) {
                let mean = f64::from(*mean);
                let electrons = (mean - black) / gain;
                let variance =
                    gain.powi(2) * (sensor.read_noise_e.powi(2) + electrons) + 1.0 / 12.0;
                sum += (dn - mean).powi(2);
                expected += variance;
                // Variance of a squared deviate: the fourth moment of Poisson plus normal noise, 3 v^2 +
                // K^4 lambda, minus v^2.
                spread += 2.0 * variance * variance + gain.powi(4) * electrons;
                light += electrons;
                count += 1.0;
            }
        }
        let found = (sum / expected - 1.0).abs();
        let name = duration(exposure_ns as f64);
        cases.push(Case::held(
            name,
            light / count,
            found,
            SURE * f64::sqrt(spread) / expected,
        ));
    }
    Ok(cases)
}
