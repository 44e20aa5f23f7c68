//! Parsing of valid messages, and error numbers of invalid ones.

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
fn headers_that_inherit_ever_more_end_the_message() {
    let program = parse("A:B;".repeat(16_000).as_bytes());
    assert_eq!(program.units.len(), MAX_NODES - 1);
    let error = program.error.unwrap();
    assert_eq!(error.code, ErrorCode::UndefinedHeader);
}

#[test]
fn parses_parameters_of_every_kind() {
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
fn syntax_errors_have_their_standard_numbers() {
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
    assert_eq!(program.units.len(), 1, "units before the mistake are kept");
}

proptest! {
    #[test]
    fn any_bytes_parse_or_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..120)) {
        parse(&bytes);
    }

    #[test]
    fn any_text_of_grammar_characters_does_not_panic(text in "[A-Ca-c0-9:;,?*#\"' .eE+-]{0,60}") {
        parse(text.as_bytes());
    }

    #[test]
    fn written_numbers_parse_back_equal(value in -1e30f64..1e30) {
        let program = parse(format!("A {value:e}").as_bytes());
        prop_assert_eq!(
            &program.units[0].params[0],
            &Param::Number { value, suffix: String::new() }
        );
    }
}
