//! The exposure pass: the projector's light at each pixel.
//!
//! | module | contents |
//! | --- | --- |
//! | `pass` | the pass over pixels and mixed pixels |
//! | `levels` | pattern levels to light: response curve, contrast ratio |
//! | `row_table` | averages of patterns that vary along one axis |
//! | `image_table` | averages of image patterns |
//! | `kernel` | averages of row patterns under blur, as weights of pattern pixels |
//! | `bell`, `soft`, `blend` | a footprint convolved with one or several Gaussians |
//! | `diffused` | image patterns on skin |
//! | `defocus` | width of the projector's blur |
//! | `flicker` | mains flicker |
//! | `indirect` | interreflection |
//! | `resolution` | resolution limit of fringes |
//! | `vignetting` | vignetting, applied in the geometry pass |

mod bell;
mod blend;
mod defocus;
mod diffused;
mod flicker;
mod image_table;
mod indirect;
mod kernel;
mod levels;
mod pass;
mod resolution;
mod row_table;
mod soft;
mod vignetting;

pub(super) use bell::{Bell, density, distribution};
pub(super) use blend::Spread;
pub(super) use defocus::Defocus;
pub(super) use flicker::{Flicker, add as add_flicker, with as with_flicker};
pub(super) use image_table::ImageTable;
pub(super) use indirect::Indirect;
pub(super) use kernel::{Blurred, HeldRow, Kernels};
pub(super) use pass::{Table, mixed, run};
pub(super) use resolution::is_resolved;
pub(super) use row_table::RowTable;
#[cfg(test)]
pub(super) use soft::Soft;
pub(super) use vignetting::Falloff;
