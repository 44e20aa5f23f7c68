//! Why a point has no projector coordinates, and how a user is told.

use super::LocalFit;

/// What a point lacks of projector coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Unread {
    /// The sequence, or too few points of the board, do not give both axes.
    #[error("without both of the projector's coordinates, or with too few of the board's points")]
    Unresolved,
    /// Hardly a pixel about the point was decoded.
    #[error("with fewer than 12 decoded pixels about them")]
    FewPixels,
    /// Pixels on one side of the point only.
    #[error("with decoded pixels on one side of them only")]
    OneSided,
    /// Pixels whose coordinates do not lie on a plane.
    #[error("about which the decoded coordinates contradict each other")]
    Scattered,
}

/// How many of some points have no coordinates, and why: "3 of 9 points are not read: 3 with ...";
/// `None` where all have some.
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
