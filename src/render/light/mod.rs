//! The exposure pass: the projector's light at each pixel.
//!
//! `exposure` runs it. `levels` converts pattern levels to light; `row_table` and `picture_table`
//! average patterns over footprints, `kernel` also with `defocus` and subsurface spread (`blend`),
//! `diffused` does so for images. `flicker` computes mains flicker, `indirect` interreflection.
//! `vignetting` acts in the geometry pass.

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
