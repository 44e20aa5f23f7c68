mod accuracy;
mod refused;
mod render;
mod whole;

use super::find;
use crate::board::Seen;
use glam::DVec2;
use render::Scene;

/// Errors of the found dots against the centroids of their true outlines.
struct Errors {
    /// RMS error per coordinate, and RMS of the predicted standard deviations.
    rms: f64,
    predicted: f64,
    worst: f64,
    mean: DVec2,
    /// Mean of the squared errors over their variance, per coordinate.
    chi2: f64,
    /// Number of dots found.
    found: usize,
    /// Number of dots that lie inside the image, including their blurred edges.
    there: usize,
}

fn errors(scene: &Scene) -> Errors {
    let seen = find(&scene.board, &scene.image()).unwrap();
    of(scene, &seen)
}

fn of(scene: &Scene, seen: &[Seen]) -> Errors {
    let truth = scene.truth(-1.0);
    let mut sums = Errors {
        rms: 0.0,
        predicted: 0.0,
        worst: 0.0,
        mean: DVec2::ZERO,
        chi2: 0.0,
        found: seen.len(),
        there: scene.truth(1.0 + 2.0 * scene.blur).len(),
    };
    let n = seen.len() as f64;
    for s in seen {
        let e = s.px - truth[&s.index];
        sums.rms += e.length_squared() / 2.0 / n;
        sums.predicted += (s.covariance.x_axis.x + s.covariance.y_axis.y) / 2.0 / n;
        sums.worst = sums.worst.max(e.length());
        sums.mean += e / n;
        sums.chi2 += e.dot(s.covariance.inverse() * e) / 2.0 / n;
    }
    sums.rms = sums.rms.sqrt();
    sums.predicted = sums.predicted.sqrt();
    println!(
        "rms {:.5} (predicted {:.5}) worst {:.5} mean {:.5} {:.5} found {}/{} chi2 {:.3}",
        sums.rms,
        sums.predicted,
        sums.worst,
        sums.mean.x,
        sums.mean.y,
        sums.found,
        sums.there,
        sums.chi2
    );
    sums
}
