//! The exposure pass: the projector's light at each pixel.
//!
//! `exposure` runs it. `levels` is what a slide's levels are as light; `row_table` and
//! `picture_table` average slides over footprints, `kernel` under `defocus` too. `flicker` is what an
//! exposure sees of the mains, `indirect` what surfaces throw on each other. `vignetting` has
//! its part in the geometry pass.

mod bell;
mod defocus;
mod exposure;
mod flicker;
mod indirect;
mod kernel;
mod levels;
mod picture_table;
mod resolution;
mod row_table;
mod soft;
mod vignetting;

pub(super) use defocus::Defocus;
pub(super) use exposure::{Table, mixed, run};
pub(super) use flicker::Flicker;
pub(super) use indirect::Indirect;
pub(super) use kernel::{Blurred, Kernels};
pub(super) use resolution::is_resolved;
pub(super) use vignetting::Falloff;
