//! Error against truth: distances between clouds and surfaces, overlap of solids, registration,
//! pictures, plots.

mod icp;
mod metrics;
mod overlap;

mod surface;
mod visible;

pub use icp::{Alignment, IcpOptions, align};
pub use metrics::{Comparison, Directed, GROSS_MM, compare};
pub use overlap::{OVERLAP_COLUMNS, Overlap, PositionErrors, TargetError, overlap, solid_moments};
pub use surface::{Foot, Surface, Surfels, Truth};
pub use visible::{GRAZING_DEG, lit_and_seen};
