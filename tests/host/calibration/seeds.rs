//! Checks that the covariance is realistic: many calibrations, each with its own poses and noise.

use crate::calibration::desk::Desk;
use crate::calibration::figures::Figures;
use phasmid::calibrate::solve::{Choice, chi_square_bound};
use phasmid::geometry::Board;
use phasmid::geometry::board_poses::Wanted;
use rayon::prelude::*;

#[test]
#[ignore = "fifty calibrations: minutes"]
fn distances_of_fifty_seeds_follow_chi_square() {
    let desk = Desk::new("pmp-bench", Board::DOTS.scaled(4.0));
    let seeds: Vec<u64> = (0..50).collect();
    let all: Vec<Figures> = seeds
        .par_iter()
        .map(|&seed| {
            let poses = desk.poses(&Wanted {
                seed,
                ..Wanted::default()
            });
            let seen = desk.sight(&poses, seed);
            Figures::new(&desk, &desk.calibrate(&seen, Choice::default()), &poses)
        })
        .collect();
    for (seed, figures) in seeds.iter().zip(&all) {
        println!("seed {seed}: {figures}");
    }
    for (name, of) in [
        (
            "all parameters",
            all.iter()
                .map(|f| (f.distance, f.freedom))
                .collect::<Vec<_>>(),
        ),
        (
            "the rig",
            all.iter()
                .map(|f| (f.rig_distance, f.rig_freedom))
                .collect(),
        ),
    ] {
        let (sum, freedom) = of.iter().fold((0.0, 0), |(s, n), (d, f)| (s + d, n + f));
        let ratio = sum / freedom as f64;
        // The sum of independent chi-square variables is chi-square distributed; its mean and
        // standard deviation:
        let sd = (2.0 / freedom as f64).sqrt();
        let beyond = of
            .iter()
            .filter(|(d, f)| *d > chi_square_bound(0.99, *f))
            .count();
        println!("{name}: {ratio:.3} +- {sd:.3} of chi-square's mean, {beyond} of 50 beyond 99 %");
        assert!((ratio - 1.0).abs() < 3.0 * sd, "{name}: {ratio}");
        assert!(beyond <= 3, "{name}: {beyond}");
    }
    assert!(
        all.iter()
            .all(|f| f.dots_px <= 0.012 && f.camera_px <= 0.015 && f.projector_px <= 0.07)
    );
}
