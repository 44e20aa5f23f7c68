//! The reference of the command line, generated from the program's help.

use std::fmt::Write;
use std::process::Command;

/// Returns the help of a command.
fn help(command: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(command)
        .arg("--help")
        .output()
        .unwrap();
    assert!(output.status.success(), "{command:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Returns the names listed under `Commands:` in a help text, or in its groups.
fn subcommands(help: &str) -> Vec<&str> {
    let grouped = help.contains("\nStart here:\n");
    let first = if grouped { "Start here:" } else { "Commands:" };
    help.lines()
        .skip_while(|line| *line != first)
        .skip(1)
        .take_while(|line| line.starts_with("  ") || grouped)
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect()
}

fn section(out: &mut String, command: &[&str]) {
    let text = help(command);
    let level = "#".repeat(command.len() + 1);
    writeln!(
        out,
        "{level} phasmid {}\n\n```text\n{}```\n",
        command.join(" "),
        trimmed(&text)
    )
    .unwrap();
    for name in subcommands(&text) {
        section(out, &[command, &[name]].concat());
    }
}

/// Removes trailing spaces of lines.
fn trimmed(text: &str) -> String {
    text.lines()
        .map(|line| format!("{}\n", line.trim_end()))
        .collect()
}

#[test]
fn the_reference_of_commands_is_the_help() {
    let top = help(&[]);
    let names = subcommands(&top);
    assert!(names.contains(&"demo") && names.contains(&"scan"), "{top}");
    let mut out = format!(
        "# Commands\n\nThis page is generated from `phasmid help`. Exit statuses and output files are in [Files and exit statuses](files.md).\n\n```text\n{}```\n\n",
        trimmed(&top)
    );
    for name in names {
        section(&mut out, &[name]);
    }
    super::assert_generated("reference/commands.md", &format!("{}\n", out.trim_end()));
}
