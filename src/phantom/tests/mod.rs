//! Tests of the modules in combination, with all built-in patients.

mod files;
mod imported;
mod motion;
mod patients;
mod planned;

use super::*;

/// States for tests: the planning phases, and a minute of the treatment.
fn states(phantom: &Phantom) -> Vec<State> {
    let planned = (0..PHASES).map(|k| phantom.planning_phase(k));
    let treated = (0..20).map(|i| phantom.state(Day::Treatment, 3.1 * f64::from(i)));
    planned.chain(treated).collect()
}

fn all() -> impl Iterator<Item = Phantom> {
    patient_names().map(|name| Phantom::new(&Patient::load(name).unwrap()))
}

fn one(name: &str) -> Phantom {
    Phantom::new(&Patient::load(name).unwrap())
}

/// Points all over the body, in the patient frame.
fn places(phantom: &Phantom, count: i64) -> Vec<DVec3> {
    let draws = random::Draws::new(9, 9);
    let stature = phantom.patient.stature_mm;
    (0..count)
        .map(|i| {
            let [u, v, w] = [0, 1, 2].map(|k| draws.even(3 * i + k));
            DVec3::new(190.0 * u, 150.0 * v, (0.2 * w - 0.01) * stature) - phantom.isocentre
        })
        .collect()
}
