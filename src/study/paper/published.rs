//! Results of the paper (Wu et al., "Virtual 3D surface imaging system for the validation of tumor
//! tracking algorithm used in surface-guided radiotherapy"), in millimetres.

/// Errors at one distance, in one view or in one light.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Mean absolute error of the cross-section.
    pub cmae: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Hausdorff distance.
    pub hd: f64,
    /// Mean distance to agreement.
    pub mdta: f64,
}

/// Distances in millimetres and the results there. Their order is inferred from the paper's text.
pub const DISTANCES: [(f64, Found); 5] = [
    (800.0, found(7.16, 7.24, 10.28, 5.86)),
    (900.0, found(3.48, 3.73, 5.36, 3.61)),
    (1000.0, found(0.52, 0.68, 1.63, 0.59)),
    (1100.0, found(3.29, 3.67, 5.24, 3.35)),
    (1200.0, found(7.31, 7.36, 11.03, 6.22)),
];

/// Mean absolute errors of the trapezoid's parts: rim, centre, foot.
pub const PARTS: [f64; 3] = [0.70, 0.62, 0.85];

/// Results for the torso from the left, from the right and from the feet; without a cross-section.
pub const VIEWS: [Found; 3] = [
    found(f64::NAN, 0.91, 2.50, 0.74),
    found(f64::NAN, 0.85, 2.43, 0.68),
    found(f64::NAN, 2.05, 3.92, 1.57),
];

/// The three rows of the paper's table of light, in the table's order; without a cross-section.
pub const LIGHT: [Found; 3] = [
    found(f64::NAN, 0.80, 1.97, 0.65),
    found(f64::NAN, 1.78, 3.06, 1.64),
    found(f64::NAN, 5.31, 8.53, 4.26),
];

/// Mean reprojection errors in pixels of camera and projector over 20 poses.
pub const REPROJECTION_PX: [f64; 2] = [0.03, 0.08];

const fn found(cmae: f64, mae: f64, hd: f64, mdta: f64) -> Found {
    Found {
        cmae,
        mae,
        hd,
        mdta,
    }
}
