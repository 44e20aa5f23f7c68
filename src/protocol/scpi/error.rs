//! Device errors: the numbers and texts of SCPI-1999 volume 2, chapter 21.

use std::fmt;

/// Maximum length of an error text with its detail (SCPI-1999 vol 2, 21.8.1).
const MAX_TEXT: usize = 255;

macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident = $number:literal, $text:literal;)*) => {
        /// A standard error number.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(i16)]
        pub enum ErrorCode { $(#[doc = $text] $name = $number,)* }

        impl ErrorCode {
            /// Returns the standard's text.
            pub fn text(self) -> &'static str {
                match self { $(Self::$name => $text,)* }
            }
        }
    };
}

codes! {
    NoError = 0, "No error";
    CommandError = -100, "Command error";
    InvalidCharacter = -101, "Invalid character";
    SyntaxError = -102, "Syntax error";
    InvalidSeparator = -103, "Invalid separator";
    DataTypeError = -104, "Data type error";
    ParameterNotAllowed = -108, "Parameter not allowed";
    MissingParameter = -109, "Missing parameter";
    CommandHeaderError = -110, "Command header error";
    HeaderSeparatorError = -111, "Header separator error";
    ProgramMnemonicTooLong = -112, "Program mnemonic too long";
    UndefinedHeader = -113, "Undefined header";
    HeaderSuffixOutOfRange = -114, "Header suffix out of range";
    NumericDataError = -120, "Numeric data error";
    InvalidCharacterInNumber = -121, "Invalid character in number";
    ExponentTooLarge = -123, "Exponent too large";
    TooManyDigits = -124, "Too many digits";
    NumericDataNotAllowed = -128, "Numeric data not allowed";
    InvalidSuffix = -131, "Invalid suffix";
    SuffixTooLong = -134, "Suffix too long";
    SuffixNotAllowed = -138, "Suffix not allowed";
    InvalidCharacterData = -141, "Invalid character data";
    CharacterDataTooLong = -144, "Character data too long";
    CharacterDataNotAllowed = -148, "Character data not allowed";
    InvalidStringData = -151, "Invalid string data";
    StringDataNotAllowed = -158, "String data not allowed";
    InvalidBlockData = -161, "Invalid block data";
    BlockDataNotAllowed = -168, "Block data not allowed";
    ExpressionNotAllowed = -178, "Expression data not allowed";
    ExecutionError = -200, "Execution error";
    TriggerError = -210, "Trigger error";
    TriggerIgnored = -211, "Trigger ignored";
    ArmIgnored = -212, "Arm ignored";
    InitIgnored = -213, "Init ignored";
    ParameterError = -220, "Parameter error";
    SettingsConflict = -221, "Settings conflict";
    DataOutOfRange = -222, "Data out of range";
    TooMuchData = -223, "Too much data";
    IllegalParameterValue = -224, "Illegal parameter value";
    OutOfMemory = -225, "Out of memory";
    FileNameNotFound = -256, "File name not found";
    SystemError = -310, "System error";
    CalibrationFailed = -340, "Calibration failed";
    QueueOverflow = -350, "Queue overflow";
    InputBufferOverrun = -363, "Input buffer overrun";
    QueryInterrupted = -410, "Query INTERRUPTED";
    QueryUnterminated = -420, "Query UNTERMINATED";
    QueryDeadlocked = -430, "Query DEADLOCKED";
}

impl ErrorCode {
    /// Returns the number that `SYSTem:ERRor?` reports.
    pub fn number(self) -> i16 {
        self as i16
    }

    /// Creates the error with device-dependent detail.
    pub fn with(self, detail: impl fmt::Display) -> DeviceError {
        DeviceError {
            code: self,
            detail: detail.to_string(),
        }
    }
}

/// A device error: a standard number with device-dependent detail.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceError {
    /// Error number.
    pub code: ErrorCode,
    /// Device-dependent detail; may be empty.
    pub detail: String,
}

impl From<ErrorCode> for DeviceError {
    fn from(code: ErrorCode) -> Self {
        code.with("")
    }
}

impl fmt::Display for DeviceError {
    /// Formats the error like the answer to `SYSTem:ERRor?`: `-222,"Data out of range;detail"`,
    /// printable ASCII, quotes doubled, the text truncated at 255 characters.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = self.code.text().to_owned();
        if !self.detail.is_empty() {
            text.push(';');
            text.push_str(&self.detail);
        }
        let clean: String = text
            .chars()
            .take(MAX_TEXT)
            .map(|c| match c {
                ' '..='~' => c,
                '\n' | '\t' => ' ',
                _ => '?',
            })
            .collect();
        write!(
            f,
            "{},\"{}\"",
            self.code.number(),
            clean.replace('"', "\"\"")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_text_follows_the_standard() {
        assert_eq!(
            DeviceError::from(ErrorCode::NoError).to_string(),
            "0,\"No error\""
        );
        assert_eq!(
            ErrorCode::UndefinedHeader
                .with("FOO \"x\"\u{7}")
                .to_string(),
            "-113,\"Undefined header;FOO \"\"x\"\"?\""
        );
        let long = ErrorCode::ExecutionError.with("x".repeat(1000)).to_string();
        assert_eq!(long.len(), 255 + "-200,\"\"".len());
    }
}
