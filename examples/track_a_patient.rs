//! Tracks a breathing patient with one scanner over the treatment couch, infers the position of a
//! lung tumour from the skin, and compares the result with the true position.
//!
//! ```sh
//! cargo run --release --example track_a_patient
//! ```

use phasmid::patient::phantom::{Day, Patient, Phantom};
use phasmid::profile::{Profile, Scene};
use phasmid::track::{Beam, HoldRules, Planned, room_from_patient};
use phasmid::{Device, Error, Pod, ScanOptions, Scanner, ServeOptions};
use phasmid::{TrackOptions, TrackProgress, Tracked};
use std::ops::ControlFlow;
use std::time::Duration;

/// Device time at which tracking ends, after two breaths of this patient.
const END: Duration = Duration::from_millis(8200);
/// Allowed distance of the tracked tumour from the true one, in millimetres.
const ALLOWED_MM: f64 = 1.5;
/// Allowed error of the tumour's amplitude, in millimetres.
const ALLOWED_AMPLITUDE_MM: f64 = 0.6;

fn main() -> Result<(), Error> {
    // Planning: the skin, the tumour, and how both move during a breath. The tracker knows nothing
    // else about the patient.
    let patient = Phantom::new(&Patient::load("p02-man-mean")?);
    let scratch = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), e))?;
    let folder = scratch.path().join("planning");
    patient.export_planning(&folder, 12.0, false, false)?;
    let planned = Planned::load(&folder)?;

    // On the day of treatment, the same patient lies on the couch with a small set-up error and
    // breathes a little less deeply. The scanner looks down from above the foot end.
    let scene = Scene::load("treatment-room")?;
    let place = scene.rig;
    let mut profile = Profile::load("sgrt-pod")?;
    // The central quarter of the image is enough, and takes less time to render.
    (profile.camera.width_px, profile.camera.height_px) = (320, 240);
    profile.camera.sensor_width_mm /= 2.0;
    let device = Device::builder().profile(profile).scene(scene).build()?;
    let serving = device.serve(&ServeOptions::default())?;

    // Connect to the scanner as to a physical scanner.
    let at = serving.endpoints();
    let scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default())?;
    let mut pods = [Pod::new("foot", scanner, place)];
    let options = TrackOptions {
        tolerance_mm: 8.0,
        rules: HoldRules {
            // Rendering a scan takes longer than a scan by a physical scanner.
            stale_ns: 5_000_000_000,
            ..HoldRules::default()
        },
        ..TrackOptions::default()
    };
    let mut scans = Vec::new();
    phasmid::track(&mut pods, &planned, &options, |progress| {
        let TrackProgress::Scan(tracked) = progress else {
            return ControlFlow::Continue(());
        };
        scans.push(tracked.clone());
        match tracked.time < END {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    })?;
    pods.into_iter().try_for_each(Pod::finish)?;
    compare(&scans, &patient);
    Ok(())
}

/// Prints the tracked tumour beside the true one. Most of its motion is along the couch.
fn compare(scans: &[Tracked], patient: &Phantom) {
    println!(" time s  true mm  tracked mm  +- mm  error mm  beam");
    let (mut truth, mut found) = (Vec::new(), Vec::new());
    for tracked in scans {
        let tumour = tracked.tumour.as_ref().expect("the chest is in sight");
        // The patient moves during the scan; compare with the truth at the middle of the scan.
        let time = tracked.middle.expect("the frames carry times");
        let wanted = true_tumour_mm(patient, time);
        let square = |axis: usize| (tumour.position_mm[axis] - wanted[axis]).powi(2);
        let error = (square(0) + square(1) + square(2)).sqrt();
        let beam = match &tracked.beam {
            Beam::On => "on".to_owned(),
            Beam::Held(why) => format!("held: {why}"),
        };
        println!(
            "{:7.2} {:8.2} {:11.2} {:6.2} {error:9.2}  {beam}",
            time.as_secs_f64(),
            wanted[1],
            tumour.position_mm[1],
            tumour.sd_mm[1]
        );
        assert!(error < ALLOWED_MM, "{error}");
        truth.push(wanted[1]);
        found.push(tumour.position_mm[1]);
    }
    let (truth, found) = (amplitude(&truth), amplitude(&found));
    println!("amplitude along the couch: true {truth:.2} mm, tracked {found:.2} mm");
    assert!((truth - found).abs() < ALLOWED_AMPLITUDE_MM);
}

/// Returns the true centroid of the tumour in the room at a device time, in millimetres from the
/// isocentre.
fn true_tumour_mm(patient: &Phantom, time: Duration) -> [f64; 3] {
    let state = patient.state(Day::Treatment, time.as_secs_f64());
    let target = patient.target(&state);
    room_from_patient().point(target.centroid_mm)
}

/// Returns the difference between the largest and the smallest value.
fn amplitude(values: &[f64]) -> f64 {
    let largest = values.iter().copied().fold(f64::MIN, f64::max);
    let smallest = values.iter().copied().fold(f64::MAX, f64::min);
    largest - smallest
}

#[cfg(test)]
mod tests {
    #[test]
    fn runs() {
        super::main().unwrap();
    }
}
