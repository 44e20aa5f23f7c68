//! Random but realistic devices that nobody tuned for: the decoder's stated errors must hold on any
//! of them.

mod coarse;
mod device;
mod held;
mod measure;
mod quiet;
mod setup;

use device::Device;
use measure::{Measured, measure};
use phasmid::profile::{Profile, Scene};
use std::ops::Range;
use std::path::Path;

/// Minimum fraction of the lit, resolved pixels that become points.
const COVERAGE: f64 = 0.97;
/// Allowed range of the RMS of error / stated standard deviation, over errors within five standard
/// deviations.
const RATIO: [f64; 2] = [0.9, 1.15];
/// The same range for each fifth of the points by standard deviation, by projector pixels per
/// camera pixel, and by modulation.
const RATIO_OF_PARTS: [f64; 2] = [0.75, 1.3];
/// Maximum fraction of points beyond five standard deviations.
const BEYOND: f64 = 0.001;
/// One device in twenty may fail a criterion if a note names the cause.
const EXCUSED: u64 = 20;

/// Returns the criteria that a device fails.
fn missed(m: &Measured) -> Vec<&'static str> {
    let within = |[low, high]: [f64; 2], [least, most]: [f64; 2]| least >= low && most <= high;
    let part = |by: usize| within(RATIO_OF_PARTS, m.parts[by]);
    [
        (m.coverage >= COVERAGE, "coverage"),
        (within(RATIO, [m.ratio; 2]), "ratio"),
        (part(0), "ratio by deviation"),
        (part(1), "ratio by w"),
        (part(2), "ratio by modulation"),
        (m.beyond <= BEYOND, "beyond five deviations"),
        (m.checked.is_ok(), "frames are not refused"),
    ]
    .into_iter()
    .filter_map(|(holds, bar)| (!holds).then_some(bar))
    .collect()
}

/// Requires that all devices meet the criteria, except the devices in `known`.
fn hold(seeds: Range<u64>, known: &[u64]) {
    let excused = (seeds.end - seeds.start) / EXCUSED;
    let (mut failed, mut warned) = (Vec::new(), Vec::new());
    for seed in seeds {
        let device = Device::new(seed);
        let measured = measure(&device, seed);
        let missed = missed(&measured);
        println!(
            "{seed:3} {}  {measured}  {}",
            device.label,
            missed.join(", ")
        );
        if let Err(doubt) = &measured.checked {
            println!("    {doubt}");
        }
        match (missed.is_empty(), measured.notes.is_empty()) {
            (true, _) => (),
            _ if known.contains(&seed) && measured.checked.is_ok() => (),
            _ if measured.checked.is_err() => failed.push(seed),
            (false, true) => failed.push(seed),
            (false, false) => warned.push(seed),
        }
    }
    assert!(
        failed.is_empty() && warned.len() as u64 <= excused,
        "devices that fail: {failed:?}; with a note that names the cause: {warned:?}, allowed {excused}"
    );
}

#[test]
fn twenty_devices() {
    hold(0..20, &[]);
}

/// Two of these 400 may fail a criterion. In one, with 4 steps and an uncorrected response curve,
/// the third harmonic causes phase errors; the other has many pixels beside edges.
#[test]
#[ignore = "3 minutes; a lane of .ci/run --whole"]
fn four_hundred_devices() {
    hold(20..40, &[]);
    hold(1000..1400, &[1162, 1246]);
}

#[test]
fn the_device_of_work_precision_is_one_of_these() {
    let device = Device::new(20);
    for (text, file) in [
        (device.profile, "zoo-20.toml"),
        (device.scene, "zoo-20-scene.toml"),
    ] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/study/work_precision");
        assert_eq!(std::fs::read_to_string(folder.join(file)).unwrap(), text);
    }
}

/// Seeds of devices for `tests/numpy_decoder.py`, one for each kind of code.
const WRITTEN: [u64; 3] = [20, 12, 14];

#[test]
#[ignore = "writes files for the lane of foreign clients"]
fn writes_devices_for_foreign_decoders() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("zoo");
    for seed in WRITTEN {
        let folder = folder.join(seed.to_string());
        std::fs::create_dir_all(&folder).unwrap();
        let device = Device::new(seed);
        for (name, text) in [
            ("profile.toml", &device.profile),
            ("scene.toml", &device.scene),
        ] {
            std::fs::write(folder.join(name), text).unwrap();
        }
        let path = |name: &str| folder.join(name).display().to_string();
        let profile = Profile::load(&path("profile.toml")).unwrap();
        assert_eq!(profile.name, format!("zoo-{seed}"));
        Scene::load(&path("scene.toml")).unwrap();
    }
}
