//! Calibrates cameras and projectors: computes a rig from images of a calibration board, and points
//! from projector coordinates.
//!
//! | Module | Contents |
//! | --- | --- |
//! | `board` | detects calibration boards in images and reads the projector's coordinates at their points |
//! | `rig` | calibrates a rig from detected boards; locates a board with a known rig |
//! | `solve` | bundle adjustment with covariance |
//! | `report` | writes the results: tables, summary and HTML page |
//! | `files` | reads and writes calibrations in OpenCV's and SLStudio's formats |
//! | `height` | the phase-to-height formula against a reference plane |

pub mod board;
pub mod files;
pub mod height;
pub mod report;
pub mod rig;
pub mod solve;

pub use phasmid_decode::triangulate::{CoordinateRow, Measured, Triangulator};
