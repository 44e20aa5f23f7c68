//! Compares every study in its quick form, and in full form those that measure no times, with their
//! snapshots.

mod common;
mod faults_matrix;
mod links;
mod zoo;

use common::{quick, whole};

#[test]
fn paper() {
    quick("paper");
}

#[test]
fn work_precision() {
    quick("work-precision");
}

#[test]
fn stability() {
    quick("stability");
}

#[test]
fn noise() {
    quick("noise");
}

#[test]
fn speed() {
    quick("speed");
}

#[test]
fn sgrt() {
    quick("sgrt");
}

#[test]
fn acceptance() {
    quick("acceptance");
}

#[test]
#[ignore = "takes minutes; a lane of `.ci/run --whole` does it"]
fn whole_forms() {
    for name in [
        "paper",
        "stability",
        "noise",
        "sgrt",
        "acceptance",
        "work-precision",
        "speed",
    ] {
        whole(name);
    }
}
