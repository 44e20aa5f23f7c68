//! What one scan says of the patient.

/// Something that has to stay within a tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// What it is called.
    pub name: &'static str,
    /// Its value, whose size counts.
    pub value: f64,
    /// Standard deviation of the value.
    pub deviation: f64,
    /// How large it may be, positive; the unit is that of the value.
    pub tolerance: f64,
}

/// What one scan says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// What has to stay within tolerance.
    pub quantities: Vec<Quantity>,
    /// Reasons to doubt it, as a person reads them.
    pub warnings: Vec<String>,
}
