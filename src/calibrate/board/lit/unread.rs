//! Reasons why a point has no projector coordinates, and a summary for messages.

use super::LocalFit;

/// Reason why a point has no projector coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Unread {
    /// The sequence does not resolve both axes, or the board has too few points.
    #[error("without both of the projector's coordinates, or with too few of the board's points")]
    Unresolved,
    /// Fewer than 12 pixels around the point were decoded.
    #[error("with fewer than 12 decoded pixels around them")]
    FewPixels,
    /// The decoded pixels lie on one side of the point only.
    #[error("with decoded pixels on one side of them only")]
    OneSided,
    /// The decoded coordinates do not lie on a plane.
    #[error("around which the decoded coordinates contradict each other")]
    Scattered,
}

/// Summarises how many points have no coordinates, and for which reasons, in one sentence. Returns
/// `None` if all points have coordinates.
pub fn unread<'a>(
    fits: impl Iterator<Item = &'a Result<LocalFit, Unread>> + Clone,
) -> Option<String> {
    let mut reasons: Vec<Unread> = fits
        .clone()
        .filter_map(|f| f.as_ref().err())
        .copied()
        .collect();
    reasons.sort_unstable();
    let each: Vec<String> = reasons
        .chunk_by(|a, b| a == b)
        .map(|same| format!("{} {}", same.len(), same[0]))
        .collect();
    (!each.is_empty()).then(|| {
        format!(
            "{} of {} points have no projector coordinates: {}",
            reasons.len(),
            fits.count(),
            each.join(", ")
        )
    })
}
