//! The commands of the device by header.

use phasmid_protocol::scpi::{DeviceError, ErrorCode, HeaderMatch, Unit, match_header};

macro_rules! commands {
    ($($name:ident $pattern:literal,)*) => {
        /// A command of the device.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(super) enum Command { $($name,)* }

        pub(super) const TABLE: &[(&str, Command)] = &[$(($pattern, Command::$name),)*];
    };
}

commands! {
    Identify "*IDN",
    Reset "*RST",
    ClearStatus "*CLS",
    EventEnable "*ESE",
    EventStatus "*ESR",
    OperationComplete "*OPC",
    ServiceEnable "*SRE",
    StatusByte "*STB",
    SelfTest "*TST",
    Wait "*WAI",
    BusTrigger "*TRG",
    Exposure "CAMera:EXPosure",
    Gain "CAMera:GAIN",
    Format "CAMera:FORMat",
    Roi "CAMera:ROI",
    Interval "CAMera:INTerval",
    Lamp "PROJector:POWer",
    Current "PROJector:CURRent",
    Shown "PROJector:PATTern",
    PatternExposure "PROJector:EXPosure",
    Select "SEQuence:SELect",
    List "SEQuence:LIST",
    Count "SEQuence:COUNt",
    Period "SEQuence:PERiod",
    Data "SEQuence:DATA",
    Image "SEQuence:IMAGe",
    DeleteImage "SEQuence:IMAGe:DELete",
    Define "SEQuence:DEFine",
    Delete "SEQuence:DELete",
    Trigger "TRIGger[:IMMediate]",
    Source "TRIGger:SOURce",
    Delay "TRIGger:DELay",
    Mode "TRIGger:MODE",
    Missed "TRIGger:MISSed",
    Initiate "INITiate[:IMMediate]",
    Continuous "INITiate:CONTinuous",
    Abort "ABORt",
    OperationEvent "STATus:OPERation[:EVENt]",
    OperationCondition "STATus:OPERation:CONDition",
    OperationEnable "STATus:OPERation:ENABle",
    QuestionableEvent "STATus:QUEStionable[:EVENt]",
    QuestionableCondition "STATus:QUEStionable:CONDition",
    QuestionableEnable "STATus:QUEStionable:ENABle",
    Preset "STATus:PRESet",
    NextError "SYSTem:ERRor[:NEXT]",
    ErrorCount "SYSTem:ERRor:COUNt",
    Version "SYSTem:VERSion",
    Baud "SYSTem:COMMunicate:SERial:BAUD",
    DataBits "SYSTem:COMMunicate:SERial:BITS",
    Parity "SYSTem:COMMunicate:SERial:PARity[:TYPE]",
    StopBits "SYSTem:COMMunicate:SERial:SBITs",
    Calibration "CALibration:DATA",
    FrameCount "DIAGnostic:FRAMes",
}

/// Returns the command for a unit's header.
///
/// # Errors
/// Returns -113 for an unknown header and -114 for a numeric suffix other than 1.
pub(super) fn find(unit: &Unit) -> Result<Command, DeviceError> {
    for (pattern, command) in TABLE {
        match match_header(pattern, unit) {
            HeaderMatch::Yes => return Ok(*command),
            HeaderMatch::Suffix => {
                return Err(ErrorCode::HeaderSuffixOutOfRange.with(unit.header()));
            }
            HeaderMatch::No => {}
        }
    }
    Err(ErrorCode::UndefinedHeader.with(unit.header()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::scpi::parse;

    /// The short and the long form of every header find the header's own command and no other.
    #[test]
    fn every_header_finds_its_own_command() {
        for (pattern, command) in TABLE {
            let long = pattern.replace(['[', ']'], "");
            let short: String = pattern
                .split('[')
                .next()
                .unwrap()
                .chars()
                .filter(|c| !c.is_ascii_lowercase())
                .collect();
            for text in [long.to_ascii_lowercase(), long, short] {
                let program = parse(text.as_bytes());
                assert_eq!(find(&program.units[0]), Ok(*command), "{text}");
            }
        }
    }
}
