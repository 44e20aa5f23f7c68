//! The folder that a calibration goes to.

use super::{Args, CAPTURES, OPENCV, TRUTH};
use crate::calibrate::report;
use crate::error::{Error, Result};
use crate::host::MANIFEST_FILE;
use std::fs;

/// Makes the folder, and refuses one with files under the names of ours unless they may go.
///
/// # Errors
/// See [`report::prepare`]; captures of an earlier calibration.
pub(super) fn prepare(args: &Args) -> Result<()> {
    let [yaml, xml] = OPENCV;
    report::prepare(&args.out, &[TRUTH, yaml, xml], args.force)?;
    let captures = args.out.join(CAPTURES);
    if !args.keep_captures || !captures.exists() {
        return Ok(());
    }
    if !args.force {
        return Err(Error::input(
            format!("--out {}", args.out.display()),
            format!("{CAPTURES}, of an earlier calibration"),
            "another folder, or --force to overwrite",
        ));
    }
    // So that no pose of an earlier calibration stands beside those of this one.
    for entry in fs::read_dir(&captures).map_err(|e| Error::io(&captures, e))? {
        let path = entry.map_err(|e| Error::io(&captures, e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("pose_") && path.join(MANIFEST_FILE).exists() {
            fs::remove_dir_all(&path).map_err(|e| Error::io(&path, e))?;
        }
    }
    Ok(())
}
