//! Replaces the module `v4l2` in builds without the feature `v4l2`.

use super::{Check, Feature, Machine, Status};
use std::path::Path;

pub(super) fn checks(_: &Machine) -> Vec<Check> {
    let found = "this program was built without the feature v4l2";
    vec![Check::ok("V4L2", Feature::V4l2, found).but(Status::Missing, None)]
}

/// Always returns `false`, as for a node that cannot be opened.
pub fn is_forgotten(_: &Path) -> bool {
    false
}
