//! Lens distortion check.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::Lens;

/// Rejects coefficients for which the image folds over, so that some pixel would have no ray or
/// two.
pub(super) fn check(lens: &Lens, field: &str, check: &Check<'_>) -> Result<()> {
    check.all_within(field, &lens.distortion, -1e3..=1e3)?;
    check.in_range()?;
    lens.folds_before().map_or(Ok(()), |px| {
        Err(check
            .source
            .violation(field, Lens::fold_found(px), Lens::FOLD_ALLOWED))
    })
}
