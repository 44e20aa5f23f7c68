//! Measures the minimum time of calls of the facade: a scan in memory; decoding the scan; and
//! decoding 64 x 64 pixels with a reused decoder, with a decoder built from a manifest, and with a
//! decoder built from the text of a manifest.
//!
//! `python/tests/bench.py` runs this program and times the same calls in Python.

use phasmid::pattern::Manifest;
use phasmid::profile::Profile;
use phasmid::{Capture, DecodeOptions, Device, Result};
use std::time::Instant;

/// Number of scans in a run; the first scans fill caches.
const SCANS: usize = 12;
/// Number of calls on small images.
const CALLS: usize = 3000;

/// Returns the minimum time of a call in milliseconds.
fn minimum_ms(times: usize, mut work: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..times {
        let begin = Instant::now();
        work()?;
        best = best.min(begin.elapsed().as_secs_f64() * 1e3);
    }
    Ok(best)
}

fn decode(capture: &Capture) -> Result<()> {
    let rig = capture.calibration.as_ref();
    let decoding = phasmid::decode(capture, rig, &DecodeOptions::default())?;
    assert!(!decoding.maps.depth.is_empty());
    Ok(())
}

fn main() -> Result<()> {
    let mut device = Device::builder().build()?;
    let sequence = device.sequences().remove(0);
    let mut capture = device.scan(&sequence)?;
    let scan = minimum_ms(SCANS, || {
        capture = device.scan(&sequence)?;
        Ok(())
    })?;
    let large = minimum_ms(SCANS, || decode(&capture))?;

    let mut profile = Profile::load("webcam-grey")?;
    (profile.camera.width_px, profile.camera.height_px) = (64, 64);
    let mut device = Device::builder().profile(profile).scene("plane").build()?;
    let mut capture = device.scan("quick-4")?;
    let decoder = capture.decoder(DecodeOptions::default())?;
    let kept = minimum_ms(CALLS, || decoder.decode(&capture.images).map(drop))?;
    let manifest = minimum_ms(CALLS, || decode(&capture))?;
    let toml = capture.manifest.to_toml();
    let text = minimum_ms(CALLS, || {
        capture.manifest = Manifest::parse(&toml, "manifest")?;
        decode(&capture)
    })?;
    println!(
        "scan {scan:.4} ms, decode {large:.4} ms; 64 x 64 px: kept decoder {kept:.4} ms, manifest \
         {manifest:.4} ms, text {text:.4} ms"
    );
    Ok(())
}
