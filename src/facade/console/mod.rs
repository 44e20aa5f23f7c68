//! Provides a console with scans, and lets the console's viewers operate scanners.
//!
//! | file | contents |
//! | --- | --- |
//! | `scan_views` | the views of a scan: maps, points and fields of view |
//! | `calibrator` | calibrates a scanner from the scans that are shown |
//! | `room_views` | the views of a patient who is tracked |
//! | `operate` | a scanner that scans and talks as viewers ask |
//! | `follower` | finds and decodes the scans of a served device, and passes requests to its service channel |
//! | `playback` | plays the recordings of a folder |
//! | `recording` | an open recording with random access |

mod calibrator;
mod follower;
mod operate;
mod playback;
mod recording;
mod room_views;
mod scan_views;

pub use follower::Follower;
pub use operate::operate;
pub use playback::Playback;
pub use room_views::RoomViews;
pub use scan_views::ScanViews;
