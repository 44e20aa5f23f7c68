use super::super::Dialect;

/// A line that begins with the first word of a command gets another error than a line of an unknown
/// command.
#[test]
fn error_number_tells_bad_arguments_from_unknown_commands() {
    let text = "name = \"w\"\ndescription = \"\"\nframing = \"line\"\n[errors]\n\
        line = \"no {number} {detail}\"\ndefault = { number = 1, text = \"\" }\n\
        busy = { number = 2, text = \"\" }\n";
    let command = |name: &str, line: &str, args: &str| {
        format!("[[command]]\nname = \"{name}\"\nline = \"{line}\"\nargs = [{args}]\n")
    };
    let number = |name: &str| format!("{{ name = \"{name}\", type = \"int\" }}");
    let commands = [
        command("a", "go X{x}", &number("x")),
        command(
            "b",
            "go X{x} Y{y}",
            &format!("{}, {}", number("x"), number("y")),
        ),
        command("c", "led off", ""),
        command("d", "t{n}", &number("n")),
    ];
    let dialect = Dialect::parse(&format!("{text}{}", commands.concat()), "words").unwrap();
    for (line, code) in [
        ("go", -109),
        ("GO X", -104),
        ("go 1", -104),
        ("go X1 Y2 Z3", -104),
        ("go 1 2 3", -108),
        ("led", -109),
        ("led out", -104),
        ("led off now", -108),
        ("t", -104),
        ("tx", -104),
        ("gone", -113),
        ("u", -113),
    ] {
        let error = dialect.asked(line.as_bytes()).unwrap_err().error;
        assert_eq!(error.code.number(), code, "{line}: {error}");
    }
    let exact = text.replace("[errors]", "[line]\nany_case = false\n[errors]");
    let exact = Dialect::parse(&format!("{exact}{}", commands.concat()), "words").unwrap();
    let error = exact.asked(b"GO").unwrap_err().error;
    assert_eq!(error.code.number(), -113);
}

/// Error messages for invalid names describe exactly the characters that names may contain.
#[test]
fn error_for_invalid_name_lists_allowed_characters() {
    let text = Dialect::text("okline").unwrap();
    for (old, new, allowed) in [
        (
            "name = \"okline\"",
            "name = \"o k\"",
            "letters, digits, '_', '-', '.'",
        ),
        (
            "name = \"version\"",
            "name = \"ver.sion\"",
            "letters, digits, '_', '?', '-'",
        ),
        (
            "name = \"maker\", type",
            "name = \"ma-ker\", type",
            "letters, digits, '_'",
        ),
    ] {
        let words = Dialect::parse(&text.replacen(old, new, 1), "it").unwrap_err();
        assert!(words.to_string().ends_with(allowed), "{words}");
    }
    assert!(Dialect::parse(&text.replacen("\"okline\"", "\"o-k.1_\"", 1), "it").is_ok());
}
