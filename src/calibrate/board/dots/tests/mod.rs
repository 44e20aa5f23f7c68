mod render;

use super::find;
use crate::geometry::Board;
use glam::{DVec2, DVec3};
use render::{Scene, bench_lens, pose};

/// Errors of the dots that were found, how many of those in the picture, mean squared error over
/// covariance.
pub struct Errors {
    pub rms: f64,
    pub worst: f64,
    pub mean: DVec2,
    pub found: usize,
    pub there: usize,
    pub chi2: f64,
    pub sigma: f64,
}

pub fn errors(scene: &Scene) -> Errors {
    let seen = find(&scene.board, &scene.picture()).unwrap();
    let truth = scene.truth(-1.0);
    let (mut square, mut worst, mut mean, mut chi2, mut sigma) =
        (0.0f64, 0.0f64, DVec2::ZERO, 0.0, 0.0f64);
    for s in &seen {
        let e = s.px - truth[&s.index];
        square += e.length_squared() / 2.0;
        worst = worst.max(e.length());
        mean += e;
        chi2 += e.dot(s.covariance.inverse() * e) / 2.0;
        sigma += (s.covariance.x_axis.x + s.covariance.y_axis.y) / 2.0;
    }
    let n = seen.len() as f64;
    Errors {
        rms: (square / n).sqrt(),
        worst,
        mean: mean / n,
        found: seen.len(),
        there: scene.truth(1.0 + 2.0 * scene.blur).len(),
        chi2: chi2 / n,
        sigma: (sigma / n).sqrt(),
    }
}

impl std::fmt::Display for Errors {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "rms {:.5} (predicted {:.5}) worst {:.5} mean {:.5} {:.5} found {}/{} chi2 {:.3}",
            self.rms,
            self.sigma,
            self.worst,
            self.mean.x,
            self.mean.y,
            self.found,
            self.there,
            self.chi2
        )
    }
}

#[test]
#[ignore]
fn explore() {
    let board = Board::DOTS.scaled(4.0);
    for (turn, tilt, axis, blur, noise) in [
        (0.0, 0.0, 0.0, 0.0, 1.0),
        (10.0, 20.0, 30.0, 0.0, 1.0),
        (10.0, 20.0, 30.0, 0.3, 1.0),
        (10.0, 20.0, 30.0, 0.6, 1.0),
        (10.0, 20.0, 30.0, 1.0, 1.0),
        (10.0, 20.0, 30.0, 1.5, 1.0),
        (10.0, 20.0, 30.0, 0.0, 4.0),
        (10.0, 60.0, 90.0, 0.0, 1.0),
        (10.0, 60.0, 0.0, 0.0, 1.0),
        (40.0, 60.0, 45.0, 0.0, 1.0),
        (40.0, 60.0, 45.0, 0.5, 1.0),
        (40.0, 60.0, 45.0, 1.0, 1.0),
        (200.0, 50.0, 135.0, 0.0, 1.0),
    ] {
        let mut scene = Scene::new(
            board,
            bench_lens(),
            pose(DVec3::new(0.0, 0.0, 1000.0), turn, tilt, axis),
        );
        scene.blur = blur;
        scene.noise = noise;
        let picture = scene.picture();
        let start = std::time::Instant::now();
        let r = find(&board, &picture);
        let took = start.elapsed();
        match r {
            Ok(_) => println!(
                "{turn} {tilt} {axis} blur {blur} noise {noise}: {} in {took:?}",
                errors(&scene)
            ),
            Err(e) => println!("{turn} {tilt} {axis} blur {blur}: {e}"),
        }
    }
}
