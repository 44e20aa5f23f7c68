//! Every study in its quick form and in its whole form, against what they said before, times apart.

mod common;
mod links;

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
#[ignore = "takes minutes; a lane of .ci/run does it"]
fn whole_forms() {
    for name in ["paper", "work-precision", "stability", "noise", "speed"] {
        whole(name);
    }
}
