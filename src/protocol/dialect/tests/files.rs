use super::super::Dialect;
use proptest::prelude::*;

/// Checks that edited dialect files are refused. Each case holds a text of a shipped file, the text
/// that replaces it, and a part of the expected error message, which must also name a line near the
/// edit.
fn assert_refused(name: &str, cases: &[(&str, &str, &str)]) {
    let shipped = Dialect::text(name).unwrap();
    for (from, to, needle) in cases {
        let at = shipped.find(from);
        let at = at.unwrap_or_else(|| panic!("{from} is not in {name}"));
        let line = 1 + shipped[..at].matches('\n').count();
        let refused = Dialect::parse(&shipped.replacen(from, to, 1), "FILE");
        let words = refused.expect_err(to).to_string();
        let told = words.strip_prefix("FILE:");
        let told = told.and_then(|rest| rest.split(':').next()?.parse::<usize>().ok());
        assert!(
            told.is_some_and(|told| told.abs_diff(line) <= 12),
            "line {line}: {words}"
        );
        assert!(words.contains(needle), "{needle} not in: {words}");
    }
}

#[test]
fn errors_in_line_dialects_name_place_and_remedy() {
    let cases = [
        (
            "framing = \"line\"",
            "framing = \"packet\"",
            "lines in another framing",
        ),
        (
            "framing = \"line\"",
            "framing = \"morse\"",
            "unknown variant",
        ),
        (
            "to_host = \"\\r\\n\"",
            "to_host = \"|\"",
            "\"\\n\", \"\\r\" or \"\\r\\n\"",
        ),
        ("max_bytes = 1024", "max_bytes = 8", "16 to 65536"),
        ("max_bytes = 1024", "max_bites = 8", "unknown field"),
        ("comment = \";\"", "comment = \"\"", "1 to 8 characters"),
        (
            "line = \"select {name}\"",
            "line = \"select {nam}\"",
            "{nam}",
        ),
        (
            "line = \"select {name}\"",
            "line = \"select\"",
            "{name} 0 times",
        ),
        (
            "line = \"select {name}\"",
            "line = \"select {name\"",
            "without a closing brace",
        ),
        (
            "line = \"list\"",
            "line = \"version\"",
            "also matches version",
        ),
        (
            "line = \"count?\"",
            "line = \"select x\"",
            "also matches select",
        ),
        ("name = \"list\"", "name = \"version\"", "already used"),
        (
            "runs = [\"SEQ:SEL {name}\"]",
            "runs = [\"SEQ:SEL {x}\"]",
            "{x}",
        ),
        (
            "runs = [\"SEQ:SEL {name}\"]",
            "runs = [\"SEQ::SEL {name}\"]",
            "SCPI",
        ),
        ("answers = [\"{count}\"]", "answers = []", "0 sources"),
        (
            "answers = [\"{count}\"]",
            "answers = [\"{count}\", \"\"]",
            "2 for 1 runs",
        ),
        (
            "reply = [\"ok {count}\"]",
            "reply = [\"ok\"]",
            "{count} 0 times",
        ),
        (
            "reply = [\"ok {count}\"]",
            "reply = [\"error 4 {count}\"]",
            "an error or an event",
        ),
        (
            "reply = [\"sequences {names}\", \"ok\"]",
            "reply = [\"{names}\", \"ok\"]",
            "an error or an event",
        ),
        (
            "reply = [\"sequences {names}\", \"ok\"]",
            "reply = [\"ok{names}\", \"ok\"]",
            "an earlier one",
        ),
        (
            "type = \"int\", unit = \"us\", min = 1",
            "type = \"u8\", unit = \"us\", min = 1",
            "or hex in lines",
        ),
        (
            "unit = \"us\", min = 1",
            "unit = \"parsec\", min = 1",
            "unknown variant",
        ),
        (
            "unit = \"us\", min = 1",
            "unit = \"us\", min = 70_000_000",
            "at most max",
        ),
        (
            "unit = \"us\", min = 1",
            "scale = 0.0, min = 1",
            "1e-12 to 1e12",
        ),
        (
            "choices = { on = \"1\", off = \"0\" }",
            "choices = {}",
            "1 to 64",
        ),
        (
            "choices = { on = \"1\", off = \"0\" }",
            "min = 3",
            "these for numbers",
        ),
        (
            "chunk = { data = \"data\"",
            "chunk = { data = \"total\"",
            "bytes",
        ),
        ("bytes = 256 }", "bytes = 1000 }", "1 to 384"),
        (
            "default = { number = 1, text = \"failed\" }",
            "default = { number = 1, text = \"a\\nb\" }",
            "without control characters",
        ),
        ("scpi = [-113]", "scpi = [-100]", "each once"),
        ("scpi = [-113]", "scpi = [7]", "-499 to -100"),
        (
            "line = \"error {number} {text}\"",
            "line = \"error {no}\"",
            "{no}",
        ),
        ("delay_ms = 20", "delay_ms = -1", "0 to 600000"),
        ("delay_ms = 20", "delay_ms = 200", "previous entry"),
        ("line = \"ready\"", "text = \"ready\"", "unknown field"),
        (
            "exposed = \"!frame {index} {id}\"",
            "exposed = \"!frame {number}\"",
            "{number}",
        ),
        (
            "exposed = \"!frame {index} {id}\"",
            "painted = \"!frame\"",
            "booted, exposed, done, missed",
        ),
        ("done = \"!done\"", "done = \"!missed\"", "two events"),
        (
            "command = \"select?\"",
            "command = \"selected\"",
            "the name of a command",
        ),
        ("command = \"fire\" }", "command = \"select\" }", "no name"),
        (
            "args = { name = \"{name}\" }",
            "args = { name = \"{title}\" }",
            "inputs of this operation",
        ),
        (
            "args = { name = \"{name}\" }",
            "args = { title = \"x\" }",
            "not an argument",
        ),
        (
            "args = { state = \"1\" }",
            "args = { state = \"half\" }",
            "allowed 0, 1",
        ),
        ("result = \"{names}\"", "result = \"{name}\"", "{name}"),
        ("light_on = {", "light_off = {", "an unknown operation"),
        (
            "result = \"{names}\"",
            "result = \"{names}\", allowed = [\"a\"]",
            "no values, or one of selected, source",
        ),
    ];
    assert_refused("okline", &cases);
    let cases = [
        ("lamp = {", "light_on = {", "another name, or host.light_on"),
        (
            "result = \"{state}\", allowed",
            "allowed",
            "settings.continuous.result",
        ),
        (
            "trigger_mode = {",
            "\"trigger mode\" = {",
            "letters, digits",
        ),
    ];
    assert_refused("scpi", &cases);
}

#[test]
fn errors_in_packet_dialects_name_place_and_remedy() {
    let cases = [
        (
            "sequence = { at = 1 }",
            "sequence = { at = 0 }",
            "do not overlap packet.flags",
        ),
        (
            "sequence = { at = 1 }",
            "sequence = { at = 6 }",
            "before the data",
        ),
        (
            "code = { at = 4, bytes = 2 }",
            "code = { at = 3, bytes = 2 }",
            "do not overlap packet.length",
        ),
        (
            "code = { at = 4, bytes = 2 }",
            "code = { at = 4, bytes = 9 }",
            "1 to 4",
        ),
        ("data_at = 6\n", "data_at = 5\n", "before the data"),
        ("data_at = 6\n", "data_at = 99\n", "0 to 64"),
        ("from = 4 }", "from = 5 }", "where the data begin"),
        ("size_bytes = 64", "max_bytes = 9999", "2 to 4096"),
        (
            "size_bytes = 64",
            "size_bytes = 64\nmax_bytes = 64",
            "size_bytes for packets",
        ),
        (
            "read = 7, reply = 6",
            "read = 7, reply = 7",
            "different bits",
        ),
        (
            "read = 7, reply = 6",
            "read = 7, reply = 8",
            "different bits",
        ),
        ("reply = 6, error = 5", "reply = 6", "without an error flag"),
        (
            "number = \"u8\"",
            "number = \"f32\"",
            "u8, u16, u32, i16 or i32",
        ),
        ("number = 8, text", "number = 256, text", "0 to 255"),
        ("code = 0x0802", "code = 0x10802", "0xffff"),
        ("code = 0x0802", "", "none"),
        ("code = 0x1A24", "code = 0x1A23", "which trigger_mode has"),
        (
            "name = \"period\", type = \"u32\"",
            "name = \"exposure\", type = \"u32\"",
            "already used",
        ),
        (
            "type = \"u32\", unit = \"us\", max",
            "type = \"int\", unit = \"us\", max",
            "in packets",
        ),
        (
            "choices = { \"0\" = \"0\", \"7\" = \"1\" }",
            "choices = { \"300\" = \"0\" }",
            "whole numbers from 0 to 255",
        ),
        (
            "{ name = \"red\", type = \"u8\", scale = 255 },",
            "{ name = \"red\", type = \"text\" },",
            "bytes = SIZE, or the last position",
        ),
        (
            "{ name = \"red\", type = \"u8\", scale = 255 },",
            "{ name = \"red\", type = \"text\", bytes = 63 },",
            "58 bytes",
        ),
        ("constant = 0x0400_0000", "constant = -1", "out of range"),
        ("bytes = 52 }", "bytes = 53 }", "1 to 52"),
        ("check = \"crc\"", "check = \"data\"", "32 bits"),
        (
            "\"2\" = \"INIT;TRIG\"",
            "\"2\" = \"INIT TRIG TRIG\"",
            "SCPI",
        ),
    ];
    assert_refused("dlpc350", &cases);
}

#[test]
fn refuses_what_is_no_dialect() {
    for (text, needle) in [
        ("", "missing field"),
        (
            "name = \"a\"\ndescription = \"\"\nframing = \"scpi\"\n",
            "1 to 128",
        ),
        (
            "name = \"a b\"\ndescription = \"\"\nframing = \"scpi\"\n",
            "letters",
        ),
        ("[", "FILE:1"),
    ] {
        let words = Dialect::parse(text, "FILE").unwrap_err().to_string();
        assert!(words.contains(needle), "{words}");
    }
    let words = Dialect::load("moon").unwrap_err().to_string();
    assert!(
        words.contains("scpi, dlpc350, okline or the path"),
        "{words}"
    );
}

#[test]
fn the_firmware_s_messages_are_listed_with_their_lines() {
    let okline = Dialect::load("okline").unwrap();
    let runs = okline.all_runs();
    let sources: Vec<_> = runs
        .iter()
        .filter(|(run, _)| run.starts_with("TRIG:SOUR "))
        .collect();
    assert_eq!(sources.len(), 4, "{sources:?}");
    let (_, place) = sources[0];
    assert!(
        place.starts_with("built-in dialect okline:") && place.contains("runs[0]"),
        "{place}"
    );
    let dlpc = Dialect::load("dlpc350").unwrap();
    let has = |run: &str| dlpc.all_runs().iter().any(|(known, _)| known == run);
    assert!(has("INIT;TRIG") && has("ABOR"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// A file from which a random piece was removed or into which one was inserted is accepted or
    /// refused without a panic.
    #[test]
    fn any_file_is_taken_or_refused(
        which in 0usize..3, at: prop::sample::Index, len in 0usize..60, piece in "[ -~\n]{0,12}",
    ) {
        let name = Dialect::names().nth(which).unwrap();
        let text = Dialect::text(name).unwrap();
        let start = at.index(text.len());
        let end = (start + len).min(text.len());
        if text.is_char_boundary(start) && text.is_char_boundary(end) {
            let text = format!("{}{piece}{}", &text[..start], &text[end..]);
            if let Ok(dialect) = Dialect::parse(&text, "FILE") {
                let _ = dialect.asked(b"exposure 7");
                let _ = dialect.reply("version", b"ok", 0);
            }
        }
    }
}
