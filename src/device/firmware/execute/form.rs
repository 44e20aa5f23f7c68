//! Which commands have a query form, a set form, and parameters.

use crate::firmware::Firmware;
use crate::firmware::table::Command;
use phasmid_protocol::scpi::{DeviceError, ErrorCode, Unit};

impl Firmware {
    /// Rejects queries of commands without a query form and set forms of query-only commands as
    /// unknown headers, and parameters of commands that take none.
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
