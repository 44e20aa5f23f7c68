//! Measures the rate of each pass relative to a memory copy of the same number of bytes in the same
//! run: this ratio varies less between machines and over time than the rate itself. Then measures
//! the cost of the decoder's options, as ratios to decoding without them.
//!
//! `cargo bench` runs all cases; `cargo bench -- geometry` runs the cases whose name contains a
//! word.

mod cases;
mod pairs;

use cases::{NAMES, case};
use pairs::{PAIRS, pair};
use phasmid::profile::Profile;
use phasmid::study::timing::Stopwatch;
use std::time::Instant;

fn main() {
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|w| name.contains(w));
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let watch = Stopwatch::new(&clock);
    let folder = tempfile::tempdir().expect("a folder");
    let profile = Profile::load("pmp-bench").expect("built in");
    println!(
        "{} x {} pixels, {} threads",
        profile.camera.width_px,
        profile.camera.height_px,
        rayon::current_num_threads()
    );
    println!(
        "{:<48}{:>10}{:>12}{:>12}{:>10}",
        "", "ms", "Mpixel/s", "copy ms", "ratio"
    );
    for name in NAMES.into_iter().filter(|name| is_wanted(name)) {
        let mut case = case(name, &profile, folder.path()).expect("built in");
        let bytes = case.pixels * case.bytes_per_pixel;
        let [all, copy] = watch.beside_a_copy(bytes, 1.5, &mut case.work);
        let best = all / case.count as f64;
        println!(
            "{name:<48}{:>10.2}{:>12.1}{:>12.3}{:>10.1}",
            best * 1e3,
            case.pixels as f64 / best * 1e-6,
            copy * 1e3,
            best / copy
        );
    }
    println!(
        "\n{:<48}{:>10}{:>12}{:>10}",
        "decoding", "without ms", "with ms", "ratio"
    );
    for name in PAIRS.into_iter().filter(|name| is_wanted(name)) {
        let mut pair = pair(name, &profile).expect("built in");
        let [without, with] = watch.in_turns(3.0, &mut pair.works);
        let ratio = with / without;
        let [without, with] = [without, with].map(|seconds| seconds * 1e3);
        println!("{name:<48}{without:>10.2}{with:>12.2}{ratio:>10.3}");
    }
}
