//! Numeric settings with bounds.

use phasmid_protocol::scpi::{Args, DeviceError, ErrorCode, Number, Quantity, Unit};

/// Evaluates a unit for a bounded setting: returns the value to set, or for a query the present
/// value or the requested bound.
pub(super) fn numeric(
    unit: &Unit,
    quantity: Quantity,
    value: f64,
    (min, max, default): (f64, f64, f64),
) -> Result<Setting, DeviceError> {
    let mut args = Args::new(&unit.params);
    if unit.query {
        if args.is_empty() {
            return Ok(Setting::Say(value));
        }
        let bound = match args.number(quantity)? {
            Number::Value(_) => return Err(ErrorCode::ParameterNotAllowed.into()),
            word => word.within(min, max, default)?,
        };
        args.finish()?;
        return Ok(Setting::Say(bound));
    }
    let number = args.number(quantity)?;
    args.finish()?;
    number.within(min, max, default).map(Setting::Set)
}

/// Result of a unit for a numeric setting.
pub(super) enum Setting {
    /// Answer of a query.
    Say(f64),
    /// Value to set.
    Set(f64),
}
