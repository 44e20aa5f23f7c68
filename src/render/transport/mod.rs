//! The geometry pass: light from projector, lamps and surfaces to the camera's pixels, once per
//! camera and state of the scene.
//!
//! | module | contents |
//! | --- | --- |
//! | `aperture` | camera pupil: depth of field |
//! | `between` | interpolation between key instants of a moving scene |
//! | `cast` | sixteen rays with their shadow rays |
//! | `edges` | edges between neighbouring points of the image |
//! | `geometry` | the pass over pixel centres |
//! | `input` | what the pass computes from |
//! | `interreflection` | gathering of indirect light |
//! | `mixed` | sampling of mixed pixels |
//! | `rays` | directions of the camera's rays |
//! | `reflect` | materials and lamps at the points that rays hit |
//! | `sampled` | sampling of all pixels with several rays |
//! | `skin` | where light entered the skin |

mod aperture;
mod between;
mod cast;
mod edges;
pub(super) mod geometry;
mod input;
pub(super) mod interreflection;
mod mixed;
mod rays;
mod reflect;
mod sampled;
mod skin;

pub(super) use aperture::Aperture;
#[cfg(test)]
pub(super) use aperture::widened;
pub(super) use between::{Between, ImageMotion};
pub(super) use input::Input;
pub(super) use interreflection::Patch;
pub(super) use rays::{Rays, ideal_points};
#[cfg(test)]
pub(super) use sampled::offset;
pub(super) use sampled::{pupil_index, turn};
