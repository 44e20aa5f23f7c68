//! Scans as a console shows them.
//!
//! | file | contents |
//! | --- | --- |
//! | `scan_views` | the views of a scan: maps, points and fields of view |
//! | `follower` | finds and decodes the scans of a served device, whoever makes them |

mod follower;
mod scan_views;

pub use follower::Follower;
pub use scan_views::ScanViews;
