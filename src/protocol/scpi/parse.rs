//! A program message to its units (IEEE 488.2 chapter 7, SCPI-1999 volume 1 chapter 6): a pure
//! function of the message's bytes.

use super::block;
use super::error::{DeviceError, ErrorCode};
use super::param::Param;

/// Longest mnemonic (IEEE 488.2, 7.6.1.4.1).
const MAX_MNEMONIC: usize = 12;
/// Longest character data (IEEE 488.2, 7.7.1.4).
const MAX_NAME: usize = 12;
/// Most digits of a number, leading zeros aside (IEEE 488.2, 7.7.2.4.1).
const MAX_DIGITS: usize = 255;

/// One mnemonic of a header in upper case, and its numeric suffix where it has one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Letters, digits and underscores, without the trailing digits.
    pub name: String,
    /// The trailing digits' value.
    pub suffix: Option<u32>,
}

/// A program message unit: one command or query.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Whether the header is a common one, `*IDN?` for instance.
    pub common: bool,
    /// The header from the root, what was inherited from the unit before included.
    pub path: Vec<Node>,
    /// Whether it ends with `?`.
    pub query: bool,
    /// What follows.
    pub params: Vec<Param>,
}

impl Unit {
    /// The header as text, for messages.
    pub fn header(&self) -> String {
        let mut text = String::from(if self.common { "*" } else { "" });
        for (i, node) in self.path.iter().enumerate() {
            if i > 0 {
                text.push(':');
            }
            text.push_str(&node.name);
            if let Some(suffix) = node.suffix {
                text.push_str(&suffix.to_string());
            }
        }
        if self.query {
            text.push('?');
        }
        text
    }
}

/// A message's units up to its first error, which voids the rest of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Program {
    /// The units in order.
    pub units: Vec<Unit>,
    /// What ended the message early.
    pub error: Option<DeviceError>,
}

/// Parses a message without its terminator.
pub fn parse(message: &[u8]) -> Program {
    let mut cursor = Cursor {
        bytes: message,
        at: 0,
    };
    let mut program = Program::default();
    let mut node = Vec::new();
    loop {
        cursor.skip_space();
        match cursor.peek() {
            None => return program,
            // An empty unit does nothing: a trailing `;` is common and harmless.
            Some(b';') => cursor.at += 1,
            Some(_) => match unit(&mut cursor, &mut node) {
                Ok(unit) => program.units.push(unit),
                Err(error) => {
                    program.error = Some(error);
                    return program;
                }
            },
        }
    }
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn eat(&mut self, byte: u8) -> bool {
        let is = self.peek() == Some(byte);
        self.at += usize::from(is);
        is
    }

    /// White space is every control character and the space (IEEE 488.2, 7.4.1.2).
    fn skip_space(&mut self) -> bool {
        !self.take_while(|b| b <= b' ').is_empty()
    }

    fn take_while(&mut self, keep: impl Fn(u8) -> bool) -> &'a [u8] {
        let start = self.at;
        while self.peek().is_some_and(&keep) {
            self.at += 1;
        }
        &self.bytes[start..self.at]
    }

    /// The error at this place: which character stands there, counted from 1.
    fn error(&self, code: ErrorCode) -> DeviceError {
        code.with(match self.peek() {
            Some(byte) => format!("'{}' at character {}", byte.escape_ascii(), self.at + 1),
            None => "at the end".into(),
        })
    }
}

fn ascii(bytes: &[u8]) -> String {
    bytes.iter().map(|&b| char::from(b)).collect()
}

/// One unit; `node` is the header path that the next one inherits.
fn unit(cursor: &mut Cursor<'_>, node: &mut Vec<Node>) -> Result<Unit, DeviceError> {
    let common = cursor.eat(b'*');
    let mut path = if common || cursor.eat(b':') {
        Vec::new()
    } else {
        node.clone()
    };
    path.push(mnemonic(cursor)?);
    while !common && cursor.eat(b':') {
        path.push(mnemonic(cursor)?);
    }
    let query = cursor.eat(b'?');
    if !common {
        node.clone_from(&path);
        node.pop();
    }
    let spaced = cursor.skip_space();
    let params = match cursor.peek() {
        None | Some(b';') => Vec::new(),
        Some(_) if spaced => params(cursor)?,
        Some(byte) if byte.is_ascii_graphic() => {
            return Err(cursor.error(ErrorCode::HeaderSeparatorError));
        }
        Some(_) => return Err(cursor.error(ErrorCode::InvalidCharacter)),
    };
    Ok(Unit {
        common,
        path,
        query,
        params,
    })
}

fn mnemonic(cursor: &mut Cursor<'_>) -> Result<Node, DeviceError> {
    match cursor.peek() {
        Some(byte) if byte.is_ascii_alphabetic() => {}
        Some(byte) if byte.is_ascii_graphic() => {
            return Err(cursor.error(ErrorCode::CommandHeaderError));
        }
        None => return Err(cursor.error(ErrorCode::CommandHeaderError)),
        Some(_) => return Err(cursor.error(ErrorCode::InvalidCharacter)),
    }
    let word = cursor.take_while(|b| b.is_ascii_alphanumeric() || b == b'_');
    if word.len() > MAX_MNEMONIC {
        return Err(ErrorCode::ProgramMnemonicTooLong.with(ascii(&word[..MAX_MNEMONIC])));
    }
    let digits = word.iter().rev().take_while(|b| b.is_ascii_digit()).count();
    let (name, suffix) = word.split_at(word.len() - digits);
    let suffix = match suffix {
        [] => None,
        digits => Some(
            ascii(digits)
                .parse()
                .map_err(|_| ErrorCode::HeaderSuffixOutOfRange.with(ascii(word)))?,
        ),
    };
    Ok(Node {
        name: ascii(name).to_ascii_uppercase(),
        suffix,
    })
}

fn params(cursor: &mut Cursor<'_>) -> Result<Vec<Param>, DeviceError> {
    let mut params = Vec::new();
    loop {
        cursor.skip_space();
        params.push(param(cursor)?);
        cursor.skip_space();
        match cursor.peek() {
            Some(b',') => cursor.at += 1,
            None | Some(b';') => return Ok(params),
            Some(_) => return Err(cursor.error(ErrorCode::InvalidSeparator)),
        }
    }
}

fn param(cursor: &mut Cursor<'_>) -> Result<Param, DeviceError> {
    match cursor.peek() {
        None | Some(b',' | b';') => Err(cursor.error(ErrorCode::SyntaxError)),
        Some(quote @ (b'"' | b'\'')) => string(cursor, quote),
        Some(b'#') => hash(cursor),
        Some(b'(') => Err(cursor.error(ErrorCode::ExpressionNotAllowed)),
        Some(b'0'..=b'9' | b'+' | b'-' | b'.') => number(cursor),
        Some(byte) if byte.is_ascii_alphabetic() => {
            let word = cursor.take_while(|b| b.is_ascii_alphanumeric() || b == b'_');
            if word.len() > MAX_NAME {
                return Err(ErrorCode::CharacterDataTooLong.with(ascii(&word[..MAX_NAME])));
            }
            Ok(Param::Name(ascii(word).to_ascii_uppercase()))
        }
        Some(byte) if byte.is_ascii_graphic() => Err(cursor.error(ErrorCode::SyntaxError)),
        Some(_) => Err(cursor.error(ErrorCode::InvalidCharacter)),
    }
}

fn string(cursor: &mut Cursor<'_>, quote: u8) -> Result<Param, DeviceError> {
    cursor.at += 1;
    let mut bytes = Vec::new();
    loop {
        bytes.extend_from_slice(cursor.take_while(|b| b != quote));
        if !cursor.eat(quote) {
            return Err(ErrorCode::InvalidStringData.with("no closing quote"));
        }
        if !cursor.eat(quote) {
            break;
        }
        bytes.push(quote);
    }
    String::from_utf8(bytes)
        .map(Param::Text)
        .map_err(|_| ErrorCode::InvalidStringData.with("not UTF-8"))
}

/// A block, or a number in another base: `#H`, `#Q`, `#B` (IEEE 488.2, 7.7.4).
fn hash(cursor: &mut Cursor<'_>) -> Result<Param, DeviceError> {
    let rest = &cursor.bytes[cursor.at..];
    if let Some((content, after)) = block::split(rest) {
        cursor.at = cursor.bytes.len() - after.len();
        return Ok(Param::Block(content.to_vec()));
    }
    let radix = match rest.get(1).map(u8::to_ascii_uppercase) {
        Some(b'H') => 16,
        Some(b'Q') => 8,
        Some(b'B') => 2,
        _ => {
            return Err(ErrorCode::InvalidBlockData.with("want #<digits><length><bytes>"));
        }
    };
    cursor.at += 2;
    let digits = ascii(cursor.take_while(|b| b.is_ascii_alphanumeric()));
    let value = u64::from_str_radix(&digits, radix)
        .map_err(|_| ErrorCode::InvalidCharacterInNumber.with(&digits))?;
    Ok(Param::Number {
        value: value as f64,
        suffix: String::new(),
    })
}

fn number(cursor: &mut Cursor<'_>) -> Result<Param, DeviceError> {
    let start = cursor.at;
    cursor.take_while(|b| b == b'+' || b == b'-');
    let whole = cursor.take_while(|b| b.is_ascii_digit()).len();
    let point = cursor.eat(b'.');
    let part = if point {
        cursor.take_while(|b| b.is_ascii_digit()).len()
    } else {
        0
    };
    if whole + part > MAX_DIGITS {
        return Err(ErrorCode::TooManyDigits.into());
    }
    // `E` begins an exponent only when digits follow; else it is a suffix.
    let mut ahead = cursor.at;
    if matches!(cursor.bytes.get(ahead), Some(b'e' | b'E')) {
        ahead += 1;
        if matches!(cursor.bytes.get(ahead), Some(b'+' | b'-')) {
            ahead += 1;
        }
        if cursor.bytes.get(ahead).is_some_and(u8::is_ascii_digit) {
            cursor.at = ahead;
            cursor.take_while(|b| b.is_ascii_digit());
        }
    }
    let text = ascii(&cursor.bytes[start..cursor.at]);
    let value: f64 = text
        .parse()
        .map_err(|_| ErrorCode::InvalidCharacterInNumber.with(&text))?;
    if !value.is_finite() {
        return Err(ErrorCode::ExponentTooLarge.into());
    }
    cursor.skip_space();
    let suffix = cursor.take_while(|b| b.is_ascii_alphabetic() || b == b'/');
    if suffix.len() > MAX_NAME {
        return Err(ErrorCode::SuffixTooLong.into());
    }
    Ok(Param::Number {
        value,
        suffix: ascii(suffix).to_ascii_uppercase(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn headers(text: &str) -> Vec<String> {
        let program = parse(text.as_bytes());
        assert_eq!(program.error, None, "{text}");
        program.units.iter().map(Unit::header).collect()
    }

    #[test]
    fn headers_inherit_the_node_of_the_unit_before() {
        for (text, expected) in [
            ("*IDN?", vec!["*IDN?"]),
            (":cam:exp 1;gain 2", vec!["CAM:EXP", "CAM:GAIN"]),
            (
                "CAM:EXP 1;*OPC?;GAIN?",
                vec!["CAM:EXP", "*OPC?", "CAM:GAIN?"],
            ),
            (
                "CAM:EXP 1;:TRIG:SOUR BUS;DEL 0",
                vec!["CAM:EXP", "TRIG:SOUR", "TRIG:DEL"],
            ),
            ("A:B:C;D:E;F", vec!["A:B:C", "A:B:D:E", "A:B:D:F"]),
            ("INIT;TRIG", vec!["INIT", "TRIG"]),
            (" ; ;CAMera1:EXP?;", vec!["CAMERA1:EXP?"]),
            ("", vec![]),
        ] {
            assert_eq!(headers(text), expected, "{text}");
        }
    }

    #[test]
    fn parameters_of_every_kind() {
        let number = |value, suffix: &str| Param::Number {
            value,
            suffix: suffix.into(),
        };
        let name = |text: &str| Param::Name(text.into());
        let text = |text: &str| Param::Text(text.into());
        for (message, expected) in [
            (&b"A 10ms"[..], vec![number(10.0, "MS")]),
            (
                b"A 8000 us , -.5e-3",
                vec![number(8000.0, "US"), number(-0.0005, "")],
            ),
            (b"A 1.E+2,+3", vec![number(100.0, ""), number(3.0, "")]),
            (b"A 2E", vec![number(2.0, "E")]),
            (
                b"A #hFf,#q17,#B101",
                vec![number(255.0, ""), number(15.0, ""), number(5.0, "")],
            ),
            (b"A on,Max", vec![name("ON"), name("MAX")]),
            (
                b"A \"a\"\"b;c\",'it''s'",
                vec![text("a\"b;c"), text("it's")],
            ),
            (
                b"A #13\n;,,1",
                vec![Param::Block(b"\n;,".to_vec()), number(1.0, "")],
            ),
        ] {
            let program = parse(message);
            assert_eq!(program.error, None, "{}", message.escape_ascii());
            assert_eq!(
                program.units[0].params,
                expected,
                "{}",
                message.escape_ascii()
            );
        }
    }

    #[test]
    fn mistakes_have_their_number() {
        use ErrorCode as E;
        for (message, code) in [
            (&b"1ABC"[..], E::CommandHeaderError),
            (b"A:", E::CommandHeaderError),
            (b"*", E::CommandHeaderError),
            (b"\xff\xfe", E::InvalidCharacter),
            (b"A 1 2", E::InvalidSeparator),
            (b"A,1", E::HeaderSeparatorError),
            (b"A 1,,2", E::SyntaxError),
            (b"A 1,", E::SyntaxError),
            (b"A @", E::SyntaxError),
            (b"ABCDEFGHIJKLM", E::ProgramMnemonicTooLong),
            (b"A99999999999", E::HeaderSuffixOutOfRange),
            (b"A 1.2.3", E::InvalidSeparator),
            (b"A --1", E::InvalidCharacterInNumber),
            (b"A .", E::InvalidCharacterInNumber),
            (b"A 1e999", E::ExponentTooLarge),
            (b"A #HXY", E::InvalidCharacterInNumber),
            (b"A #0abc", E::InvalidBlockData),
            (b"A #19abc", E::InvalidBlockData),
            (b"A \"open", E::InvalidStringData),
            (b"A '\xff'", E::InvalidStringData),
            (b"A (1,2)", E::ExpressionNotAllowed),
            (b"A ABCDEFGHIJKLM", E::CharacterDataTooLong),
        ] {
            let program = parse(message);
            let error = program
                .error
                .unwrap_or_else(|| panic!("{}", message.escape_ascii()));
            assert_eq!(error.code, code, "{}", message.escape_ascii());
        }
        let program = parse(b"*CLS;CAM:EXP 1,;*RST");
        assert_eq!(
            program.units.len(),
            1,
            "what stands before the mistake is kept"
        );
    }

    proptest! {
        #[test]
        fn any_bytes_parse_or_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..120)) {
            parse(&bytes);
        }

        #[test]
        fn any_text_of_the_grammar_s_characters(text in "[A-Ca-c0-9:;,?*#\"' .eE+-]{0,60}") {
            parse(text.as_bytes());
        }

        #[test]
        fn numbers_go_round(value in -1e30f64..1e30) {
            let program = parse(format!("A {value:e}").as_bytes());
            prop_assert_eq!(
                &program.units[0].params[0],
                &Param::Number { value, suffix: String::new() }
            );
        }
    }
}
