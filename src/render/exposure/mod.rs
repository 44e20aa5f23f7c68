//! The exposure pass computes the projector's light at each pixel from the maps of the geometry
//! pass. This module also holds the light sources and lenses that both passes use.
//!
//! | module | contents |
//! | --- | --- |
//! | `pass` | the pass over pixels and mixed pixels |
//! | `buffer` | maps over the pixels, filled by the geometry pass |
//! | `levels` | pattern levels to light: response curve, contrast ratio |
//! | `row_table` | averages of patterns that vary along one axis |
//! | `image_table` | averages of image patterns |
//! | `kernel` | averages of row patterns under blur, as weights of pattern pixels |
//! | `bell` | a footprint convolved with a Gaussian |
//! | `blend` | the same with the spread of light under skin |
//! | `window` | the pattern pixels under a kernel |
//! | `skin_maps` | light on skin at each pixel |
//! | `diffused` | image patterns on skin |
//! | `defocus` | width of the projector's blur |
//! | `flicker` | mains flicker |
//! | `lamps` | light sources other than the projector |
//! | `indirect_map`, `indirect` | interreflection |
//! | `shade` | the projector's light at points of surfaces |
//! | `vignetting` | vignetting, applied in the geometry pass |

mod bell;
mod blend;
mod buffer;
mod defocus;
mod diffused;
mod flicker;
mod image_table;
mod indirect;
mod indirect_map;
mod kernel;
mod lamps;
mod levels;
mod pass;
mod row_table;
mod shade;
mod skin_maps;
mod vignetting;
mod window;

#[cfg(test)]
pub(super) use bell::Soft;
pub(super) use bell::{Bell, density, distribution};
#[cfg(test)]
pub(super) use blend::Spread;
pub(super) use buffer::{Band, GeometryBuffer, KeyLevels, Mixed};
pub(super) use flicker::{Flicker, add as add_flicker, with as with_flicker};
pub(super) use image_table::ImageTable;
pub(super) use indirect::Indirect;
pub(super) use indirect_map::{BLOCK, Gathering, InterreflectionMap};
pub(super) use kernel::{Blurred, HeldRow};
pub(super) use lamps::{Lamp, LampShape};
pub(super) use pass::{Table, mixed, run};
pub(super) use row_table::RowTable;
pub(super) use shade::Optics;
pub(super) use skin_maps::SkinMaps;
pub(super) use vignetting::Falloff;
