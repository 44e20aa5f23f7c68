//! The reading that one scan provides for the beam hold.

use crate::ScanWarning;

/// A quantity that has to stay within a tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Name, as shown to users.
    pub name: &'static str,
    /// Value; its absolute value is compared with the tolerance.
    pub value: f64,
    /// Standard deviation of the value.
    pub deviation: f64,
    /// Positive tolerance, in the unit of the value.
    pub tolerance: f64,
}

/// The reading of one scan.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// Quantities that have to stay within tolerance.
    pub quantities: Vec<Quantity>,
    /// Reasons to doubt the reading.
    pub warnings: Vec<ScanWarning>,
}
