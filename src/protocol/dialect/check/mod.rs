//! Builds a dialect from a file, or reports the line of the file that is inconsistent.

mod commands;
mod fields;
mod framing;
mod host;
mod reading;
mod unasked;

use super::Dialect;
use super::command::{Command, Framing};
use super::field::Field;
use super::file::File;
use super::overlap::{Fielded, overlap};
use super::template::Template;
use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use reading::Check;

/// Checks a file and returns its dialect.
pub(super) fn dialect(file: &File, source: &TomlSource) -> Result<Dialect> {
    let check = &Check { source, file };
    check.name("name", &file.name, &['-', '.'])?;
    let printable = !file.description.contains(char::is_control) && file.description.len() <= 200;
    check.that(
        printable,
        "description",
        format!("{:?}", file.description),
        "one line of at most 200 bytes",
    )?;
    let framing = framing::framing(check)?;
    let commands = commands::commands(check, &framing)?;
    let runs = commands::runs(check, &commands)?;
    let errors = unasked::errors(check, &framing)?;
    let events = unasked::events(check, &framing)?;
    let boot = unasked::boot(check, &framing)?;
    let host = host::host(check, &commands)?;
    let dialect = Dialect {
        name: file.name.clone(),
        description: file.description.clone(),
        echo: file.line.as_ref().is_some_and(|line| line.echo),
        framing,
        commands,
        errors,
        events,
        boot,
        host,
        runs,
    };
    told_apart(check, &dialect)?;
    Ok(dialect)
}

/// Rejects a dialect if some line matches two of its templates.
fn told_apart(check: &Check<'_>, dialect: &Dialect) -> Result<()> {
    let Framing::Line(ends) = &dialect.framing else {
        return Ok(());
    };
    let both = |a: Fielded<'_>, b: Fielded<'_>| overlap(a, b, ends.any_case);
    for (at, command) in dialect.commands.iter().enumerate() {
        for other in &dialect.commands[..at] {
            let clash = both((&command.line, &command.args), (&other.line, &other.args));
            check.that(
                !clash,
                &format!("command[{at}].line"),
                format!("a line that also matches {}", other.name),
                "lines that differ in their text",
            )?;
        }
        replies_apart(check, dialect, (at, command), &both)?;
    }
    let numbers = ["index", "id"].map(Field::int);
    for (at, (_, template)) in dialect.events.iter().enumerate() {
        let clash = dialect.events[..at]
            .iter()
            .any(|(_, other)| both((template, &numbers), (other, &numbers)));
        check.that(
            !clash,
            "events",
            "two events with the same line",
            "lines that differ in their text",
        )?;
    }
    Ok(())
}

/// Checks that a host cannot mistake the dialect's unsolicited lines for the lines of a reply.
fn replies_apart(
    check: &Check<'_>,
    dialect: &Dialect,
    (at, command): (usize, &Command),
    both: &dyn Fn(Fielded<'_>, Fielded<'_>) -> bool,
) -> Result<()> {
    let numbers = ["index", "id", "number"].map(Field::int);
    let events = dialect.events.iter().map(|(_, template)| template);
    let errors = dialect.errors.iter().flat_map(|errors| &errors.line);
    let others: Vec<&Template> = events.chain(errors).collect();
    for (line, template) in command.reply.iter().enumerate() {
        let field = format!("command[{at}].reply[{line}]");
        let own = (template, &command.values[..]);
        let unasked = others.iter().any(|other| both(own, (other, &numbers)));
        check.that(
            !unasked,
            &field,
            "a line that also matches an error or an event",
            "lines that differ in their text",
        )?;
        let earlier = command.reply[..line]
            .iter()
            .any(|other| both(own, (other, &command.values)));
        check.that(
            !earlier,
            &field,
            "a line that also matches an earlier one",
            "lines that differ in their text",
        )?;
    }
    Ok(())
}
