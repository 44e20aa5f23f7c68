//! Settings that are numbers with bounds.

use phasmid_protocol::scpi::{Args, DeviceError, ErrorCode, Number, Quantity, Unit};

/// A setting with its bounds: what to set, or with `?` the value, or a bound when asked for one.
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

/// What a unit makes of a numeric setting.
pub(super) enum Setting {
    /// A query answers this.
    Say(f64),
    /// An order sets this.
    Set(f64),
}
