//! What a calibration leaves behind: the rig, every point it rests on, how well it fits, and a page
//! that shows all of it.
//!
//! [`prepare`] refuses a folder before the work begins, [`write()`] fills it at the end; in between,
//! the pictures of what was found go there under the names of [`picture_names`].

mod about;
mod covariance;
mod folder;
mod number;
mod page;
mod points;
mod poses;
mod summary;
#[cfg(test)]
mod tests;

pub use about::{About, picture_names};
pub use folder::{FILES, is_calibration, prepare};
pub use summary::{Figures, LeftOutPose, Summary, SummaryParameter};

use super::rig::Calibration;
use phasmid_core::error::Result;
use phasmid_core::new_file::replace;
use std::io::Write;
use std::path::Path;

/// Writes all of [`FILES`] into `folder`, which [`prepare`] has made: each whole or not at all, and
/// `summary.json`, which marks the folder as a calibration's, last.
///
/// # Errors
/// What the system refuses.
pub fn write(folder: &Path, calibration: &Calibration, about: &About) -> Result<Summary> {
    let summary = Summary::new(calibration, about);
    let [page, points, poses, parameters, covariance, rig, figures] = FILES;
    let solution = &calibration.solution;
    replace(&folder.join(points), |out| points::write(calibration, out))?;
    replace(&folder.join(poses), |out| {
        poses::write(calibration, about, out)
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
