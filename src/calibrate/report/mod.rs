//! Writes the results of a calibration: the rig, every point it is based on, how well it fits, and
//! an HTML page that shows all of this.
//!
//! [`check_folder`] checks the output folder before the calibration begins; [`write()`] fills the
//! folder, or a draft of it, at the end. The caller stores images of the detected boards in the same
//! folder under the names from [`image_names`].
//!
//! | File | Contents |
//! | --- | --- |
//! | `folder` | the folder and its check |
//! | `about` | origin of the calibration, file names of images |
//! | `boards`, `covariance` | CSV tables |
//! | `summary` | figures for the screen and `summary.json` |
//! | `page` | `report.html` |
//! | `number` | formatting of numbers and names |

mod about;
mod boards;
mod covariance;
mod folder;
mod number;
mod page;
mod summary;
#[cfg(test)]
mod tests;

pub use about::{About, image_names};
pub use folder::{FILES, MARKER, check_folder, is_calibration};
pub use summary::{Figures, LeftOutPose, Summary, SummaryParameter};

use super::rig::Calibration;
use phasmid_core::error::Result;
use phasmid_core::new_file::replace;
use std::io::Write;
use std::path::Path;

/// Writes all of [`FILES`] into `folder`, which must exist. Each file is written completely or not at
/// all; `summary.json`, which marks the folder as a calibration, is written last.
///
/// # Errors
/// Returns an error if the file system fails.
pub fn write(folder: &Path, calibration: &Calibration, about: &About) -> Result<Summary> {
    let summary = Summary::new(calibration, about);
    let [page, points, poses, parameters, covariance, rig, figures] = FILES;
    let solution = &calibration.solution;
    replace(&folder.join(points), |out| {
        boards::write_points(calibration, out)
    })?;
    replace(&folder.join(poses), |out| {
        boards::write_poses(calibration, about, out)
    })?;
    replace(&folder.join(parameters), |out| {
        covariance::write_parameters(solution, out)
    })?;
    replace(&folder.join(covariance), |out| {
        covariance::write(solution, out)
    })?;
    replace(&folder.join(rig), |out| {
        out.write_all(solution.rig.to_toml().as_bytes())
    })?;
    replace(&folder.join(page), |out| {
        out.write_all(page::page(calibration, about, &summary).as_bytes())
    })?;
    replace(&folder.join(figures), |out| {
        out.write_all(summary.to_json().as_bytes())
    })?;
    Ok(summary)
}
