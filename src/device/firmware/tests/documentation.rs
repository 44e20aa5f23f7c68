//! Checks that the documentation of the commands matches the device.

use super::Port;
use crate::firmware::table;

/// Returns the first cell of each table row that starts with a command, without backticks.
fn documented() -> Vec<&'static str> {
    let rows = include_str!("../commands.md").lines();
    rows.filter_map(|line| line.strip_prefix("| `")?.split_once("` |"))
        .map(|(cell, _)| cell)
        .collect()
}

/// Each command has one row, which shows whether it can be set, queried, or both.
#[test]
fn documentation_lists_exactly_the_commands() {
    let firmware = Port::new().firmware;
    let takes = |text: &str| {
        let program = phasmid_protocol::scpi::parse(text.as_bytes());
        let unit = &program.units[0];
        let command = table::find(unit).unwrap();
        firmware.check_form(unit, command).is_ok()
    };
    let mut expected: Vec<String> = table::TABLE
        .iter()
        .map(|(pattern, _)| {
            let header = pattern.replace(['[', ']'], "");
            match (takes(&header), takes(&format!("{header}?"))) {
                (true, true) => format!("{pattern}(?)"),
                (true, false) => (*pattern).to_owned(),
                (false, asked) => {
                    assert!(asked, "{pattern}");
                    format!("{pattern}?")
                }
            }
        })
        .collect();
    let mut found = documented();
    expected.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, expected);
}

/// Checks the documented values after `*RST`, and bounds that do not depend on the profile.
#[test]
fn documented_values_match_the_device() {
    let mut port = Port::new();
    port.tell("*RST");
    for (query, answer) in [
        ("CAM:GAIN?;GAIN? MIN", "0;0"),
        ("CAM:INT? MIN;INT? MAX", "0.0001;60"),
        ("PROJ:POW?;CURR?;PATT?", "1;1;WHIT"),
        ("SEQ:PER? MAX", "60"),
        ("TRIG:SOUR?;MODE?;DEL?;DEL? MAX", "INT;SEQ;0;60"),
        ("INIT:CONT?", "0"),
        ("SYST:VERS?", "1999.0"),
    ] {
        assert_eq!(port.ask(query), answer, "{query}");
    }
}
