//! Types of parameters, and their extraction by commands with the standard's error for each
//! mismatch. Words are matched against keywords in SCPI notation, in which capitals are the short
//! form.

use super::error::{DeviceError, ErrorCode};

/// One parameter as written in the message.
#[derive(Debug, Clone, PartialEq)]
pub enum Param {
    /// A finite number; the suffix is in upper case and empty if absent.
    Number {
        /// The number without its suffix.
        value: f64,
        /// The unit, for example `MS`.
        suffix: String,
    },
    /// Character data in upper case.
    Name(String),
    /// A string without quotes.
    Text(String),
    /// The bytes of a block.
    Block(Vec<u8>),
}

/// Physical quantity of a number, which determines the allowed unit suffixes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// A plain number.
    Plain,
    /// Seconds: S, MS, US, NS.
    Time,
    /// Decibels: DB.
    Decibel,
    /// A ratio, or a percentage with the suffix PCT.
    Ratio,
}

impl Quantity {
    /// Returns the number of suffixed units per base unit. Values are divided by it, because 20 /
    /// 1e6 is the double nearest to 20 us and 20 * 1e-6 is not: a value entered at a limit must
    /// count as within range.
    fn divisor(self, suffix: &str) -> Result<f64, DeviceError> {
        match (self, suffix) {
            (_, "") => Ok(1.0),
            (Self::Plain, _) => Err(ErrorCode::SuffixNotAllowed.with(suffix)),
            (Self::Time, "S") | (Self::Decibel, "DB") => Ok(1.0),
            (Self::Time, "MS") => Ok(1e3),
            (Self::Time, "US") => Ok(1e6),
            (Self::Time, "NS") => Ok(1e9),
            (Self::Ratio, "PCT") => Ok(1e2),
            _ => Err(ErrorCode::InvalidSuffix.with(suffix)),
        }
    }
}

/// A numeric parameter: a value in the quantity's base unit, or one of SCPI's special words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A number in the base unit.
    Value(f64),
    /// `MINimum`.
    Min,
    /// `MAXimum`.
    Max,
    /// `DEFault`.
    Default,
}

impl Number {
    /// Returns the value if it is in range, with special words replaced by `min`, `max` or
    /// `default`.
    ///
    /// # Errors
    /// Returns -222 with the value and the range if it is out of range.
    pub fn within(self, min: f64, max: f64, default: f64) -> Result<f64, DeviceError> {
        let value = match self {
            Self::Value(value) => value,
            Self::Min => min,
            Self::Max => max,
            Self::Default => default,
        };
        if (min..=max).contains(&value) {
            Ok(value)
        } else {
            Err(ErrorCode::DataOutOfRange.with(format!("{value}, allowed {min} to {max}")))
        }
    }
}

/// The parameters of a unit, taken one at a time.
pub struct Args<'a> {
    params: std::slice::Iter<'a, Param>,
}

impl<'a> Args<'a> {
    /// Returns the parameters of a unit, starting with the first.
    pub fn new(params: &'a [Param]) -> Self {
        Self {
            params: params.iter(),
        }
    }

    /// Returns whether no parameters are left.
    pub fn is_empty(&self) -> bool {
        self.params.len() == 0
    }

    fn next(&mut self) -> Result<&'a Param, DeviceError> {
        self.params
            .next()
            .ok_or_else(|| ErrorCode::MissingParameter.into())
    }

    /// Takes the next parameter as a number of a quantity.
    ///
    /// # Errors
    /// Returns -109 if none is left, -131 or -138 for its suffix, -141 for an unknown word, -158 or
    /// -168 for another type.
    pub fn number(&mut self, quantity: Quantity) -> Result<Number, DeviceError> {
        match self.next()? {
            Param::Number { value, suffix } => quantity
                .divisor(suffix)
                .map(|divisor| Number::Value(value / divisor)),
            Param::Name(word) => [
                ("MINimum", Number::Min),
                ("MAXimum", Number::Max),
                ("DEFault", Number::Default),
            ]
            .into_iter()
            .find(|(pattern, _)| keyword_matches(pattern, word))
            .map(|(_, number)| number)
            .ok_or_else(|| ErrorCode::InvalidCharacterData.with(word)),
            other => Err(unwanted(other)),
        }
    }

    /// Takes the next parameter as a boolean: ON, OFF, or a number, which is true if it rounds to a
    /// nonzero integer (SCPI-1999 vol 1, 7.3).
    ///
    /// # Errors
    /// Returns -109 if none is left, -141 for an unknown word, -138 for a suffix, -158 or -168 for
    /// another type.
    pub fn boolean(&mut self) -> Result<bool, DeviceError> {
        match self.next()? {
            Param::Number { value, suffix } => {
                Quantity::Plain.divisor(suffix)?;
                Ok(value.round() != 0.0)
            }
            Param::Name(word) if word == "ON" => Ok(true),
            Param::Name(word) if word == "OFF" => Ok(false),
            Param::Name(word) => Err(ErrorCode::InvalidCharacterData.with(word)),
            other => Err(unwanted(other)),
        }
    }

    /// Takes the next parameter as one word of a list in SCPI notation, for example `SOFTware`.
    ///
    /// # Errors
    /// Returns -109 if no parameter is left, -224 with the list for an unknown word, and -128, -158
    /// or -168 for another type.
    pub fn choice<T: Copy>(&mut self, choices: &[(&str, T)]) -> Result<T, DeviceError> {
        match self.next()? {
            Param::Name(word) => choices
                .iter()
                .find(|(pattern, _)| keyword_matches(pattern, word))
                .map(|(_, value)| *value)
                .ok_or_else(|| {
                    let words: Vec<_> = choices.iter().map(|(word, _)| *word).collect();
                    ErrorCode::IllegalParameterValue
                        .with(format!("{word}, allowed {}", words.join("|")))
                }),
            other => Err(unwanted(other)),
        }
    }

    /// Takes the next parameter if it is a word.
    pub fn word(&mut self) -> Option<&'a str> {
        match self.params.as_slice().first() {
            Some(Param::Name(word)) => {
                self.params.next();
                Some(word)
            }
            _ => None,
        }
    }

    /// Takes the next parameter as a string.
    ///
    /// # Errors
    /// Returns -109 if none is left, -128, -148 or -168 for another type.
    pub fn text(&mut self) -> Result<&'a str, DeviceError> {
        match self.next()? {
            Param::Text(text) => Ok(text),
            other => Err(unwanted(other)),
        }
    }

    /// Takes the next parameter as a block.
    ///
    /// # Errors
    /// Returns -109 if none is left, -128, -148 or -158 for another type.
    pub fn block(&mut self) -> Result<&'a [u8], DeviceError> {
        match self.next()? {
            Param::Block(bytes) => Ok(bytes),
            other => Err(unwanted(other)),
        }
    }

    /// Checks that no parameters are left.
    ///
    /// # Errors
    /// Returns -108 if a parameter is left.
    pub fn finish(mut self) -> Result<(), DeviceError> {
        match self.params.next() {
            None => Ok(()),
            Some(_) => Err(ErrorCode::ParameterNotAllowed.into()),
        }
    }
}

/// Returns whether an upper-case word is the short or the long form of a keyword such as
/// `SOFTware`.
pub fn keyword_matches(pattern: &str, word: &str) -> bool {
    let short = pattern
        .find(|c: char| c.is_ascii_lowercase())
        .map_or(pattern, |end| &pattern[..end]);
    word == short || word.eq_ignore_ascii_case(pattern)
}

fn unwanted(param: &Param) -> DeviceError {
    match param {
        Param::Number { .. } => ErrorCode::NumericDataNotAllowed,
        Param::Name(_) => ErrorCode::CharacterDataNotAllowed,
        Param::Text(_) => ErrorCode::StringDataNotAllowed,
        Param::Block(_) => ErrorCode::BlockDataNotAllowed,
    }
    .into()
}

/// Formats a string as a parameter or reply: in double quotes, with quotes inside doubled.
pub fn quote(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    fn with<T>(
        text: &str,
        take: impl FnOnce(&mut Args<'_>) -> Result<T, DeviceError>,
    ) -> Result<T, i16> {
        let program = parse(format!("A {text}").as_bytes());
        assert_eq!(program.error, None, "{text}");
        let mut args = Args::new(&program.units[0].params);
        take(&mut args)
            .and_then(|value| args.finish().map(|()| value))
            .map_err(|e| e.code.number())
    }

    #[test]
    fn units_scale_and_foreign_ones_are_refused() {
        let time = |text: &str| with(text, |a| a.number(Quantity::Time));
        assert_eq!(time("10ms"), Ok(Number::Value(0.01)));
        assert_eq!(time("20us"), Ok(Number::Value(0.00002)));
        assert_eq!(time("0.008"), Ok(Number::Value(0.008)));
        assert_eq!(time("MAXimum"), Ok(Number::Max));
        assert_eq!(time("5 V"), Err(-131));
        assert_eq!(time("LOUD"), Err(-141));
        assert_eq!(time("'x'"), Err(-158));
        assert_eq!(time("#11x"), Err(-168));
        assert_eq!(time("1,2"), Err(-108));
        assert_eq!(with("5 S", |a| a.number(Quantity::Plain)), Err(-138));
        assert_eq!(
            with("50PCT", |a| a.number(Quantity::Ratio)),
            Ok(Number::Value(0.5))
        );
    }

    #[test]
    fn reads_booleans_words_and_strings_and_refuses_others() {
        assert_eq!(with("ON", |a| a.boolean()), Ok(true));
        assert_eq!(with("0", |a| a.boolean()), Ok(false));
        assert_eq!(with("MAYBE", |a| a.boolean()), Err(-141));
        let source = |text: &str| with(text, |a| a.choice(&[("SOFTware", 1), ("BUS", 2)]));
        assert_eq!(source("soft"), Ok(1));
        assert_eq!(source("SOFTWARE"), Ok(1));
        assert_eq!(source("SOFTW"), Err(-224));
        assert_eq!(source("3"), Err(-128));
        assert_eq!(with("3", |a| a.text().map(str::to_owned)), Err(-128));
        assert_eq!(with("X", |a| a.block().map(<[u8]>::to_vec)), Err(-148));
        assert_eq!(quote("a\"b"), "\"a\"\"b\"");
    }

    #[test]
    fn range_error_states_the_range() {
        let error = Number::Value(9.0).within(0.0, 1.0, 0.5).unwrap_err();
        assert_eq!(
            error.to_string(),
            "-222,\"Data out of range;9, allowed 0 to 1\""
        );
        assert_eq!(Number::Max.within(0.0, 1.0, 0.5), Ok(1.0));
    }
}
