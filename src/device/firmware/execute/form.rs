//! Checks whether a command may be queried or set and may have parameters, and sets and queries
//! numeric settings with bounds.

use crate::firmware::Firmware;
use crate::firmware::table::Command;
use phasmid_protocol::scpi::{Args, DeviceError, ErrorCode, Number, Quantity, Unit};

impl Firmware {
    /// Rejects the query of a command without a query form, and the set form of a query-only
    /// command, as an unknown header. Rejects parameters of a command without parameters.
    pub(in crate::firmware) fn check_form(
        &self,
        unit: &Unit,
        command: Command,
    ) -> Result<(), DeviceError> {
        use Command as C;
        let only_query = matches!(
            command,
            C::Identify
                | C::EventStatus
                | C::StatusByte
                | C::SelfTest
                | C::List
                | C::Count
                | C::Data
                | C::OperationEvent
                | C::OperationCondition
                | C::QuestionableEvent
                | C::QuestionableCondition
                | C::NextError
                | C::ErrorCount
                | C::Version
                | C::Baud
                | C::DataBits
                | C::Parity
                | C::StopBits
                | C::Calibration
                | C::FrameCount
                | C::Missed
        );
        let only_order = matches!(
            command,
            C::Reset
                | C::ClearStatus
                | C::Wait
                | C::BusTrigger
                | C::Image
                | C::DeleteImage
                | C::Define
                | C::Delete
                | C::Trigger
                | C::Initiate
                | C::Abort
                | C::Preset
        );
        if (only_query && !unit.query) || (only_order && unit.query) {
            return Err(ErrorCode::UndefinedHeader.with(unit.header()));
        }
        let bare = only_query
            || matches!(
                command,
                C::Reset
                    | C::ClearStatus
                    | C::Wait
                    | C::BusTrigger
                    | C::Trigger
                    | C::Initiate
                    | C::Abort
                    | C::Preset
                    | C::OperationComplete
            )
            || unit.query && !numeric_command(command);
        if bare && !unit.params.is_empty() {
            return Err(ErrorCode::ParameterNotAllowed.with(unit.header()));
        }
        Ok(())
    }
}

/// Returns whether a command's query accepts MINimum, MAXimum and DEFault.
fn numeric_command(command: Command) -> bool {
    matches!(
        command,
        Command::Exposure
            | Command::Gain
            | Command::Interval
            | Command::Current
            | Command::Period
            | Command::Delay
            | Command::PatternExposure
    )
}

/// Evaluates a unit for a numeric setting with bounds. Returns the value to set or, for a query, the
/// present value or the requested bound.
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

/// Result of evaluating a unit for a numeric setting.
pub(super) enum Setting {
    /// Answer of a query.
    Say(f64),
    /// Value to set.
    Set(f64),
}
