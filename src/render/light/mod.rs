//! The exposure pass: the projector's light at each pixel.
//!
//! `exposure` runs it. `levels` is what a slide's levels are as light; `row_table` and
//! `picture_table` average slides over footprints, `kernel` under `defocus` and the spread of light
//! under skin (`blend`) too, as `diffused` does with pictures. `flicker` is what an exposure sees of
//! the mains, `indirect` what surfaces throw on each other. `vignetting` has
//! its part in the geometry pass.

mod bell;
mod blend;
mod defocus;
mod diffused;
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

pub(super) use bell::{Bell, density, distribution};
pub(super) use blend::Spread;
pub(super) use defocus::Defocus;
pub(super) use exposure::{Table, mixed, run};
pub(super) use flicker::{Flicker, add as add_flicker, with as with_flicker};
pub(super) use indirect::Indirect;
pub(super) use kernel::{Blurred, HeldRow, Kernels};
pub(super) use picture_table::PictureTable;
pub(super) use resolution::is_resolved;
pub(super) use row_table::RowTable;
#[cfg(test)]
pub(super) use soft::Soft;
pub(super) use vignetting::Falloff;
