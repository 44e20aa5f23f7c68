//! Compares measured clouds and meshes with the ground truth. Depends on `phasmid-core` and
//! `phasmid-geometry` only, and on no device-side crate.
//!
//! | module | contents |
//! | --- | --- |
//! | `icp` | registration of a cloud onto a surface |
//! | `metrics` | distances between cloud and truth in both directions |
//! | `overlap` | overlap of closed meshes, target position errors |
//! | `surface` | distance queries to meshes and clouds |
//! | `visible` | the part of the truth that is lit and seen |

mod icp;
mod metrics;
mod overlap;

mod surface;
mod visible;

pub use icp::{Alignment, IcpOptions, align};
pub use metrics::{Comparison, Directed, GROSS_MM, GROSS_SIGMAS, OneWay, Stated, compare};
pub use overlap::{OVERLAP_COLUMNS, Overlap, PositionErrors, TargetError, overlap, solid_moments};
pub use surface::{Foot, Surface, Surfels, Truth};
pub use visible::{GRAZING_DEG, lit_and_seen};
