//! Builds a dialect from a file, or reports which line is inconsistent.

mod commands;
mod fields;
mod framing;
mod host;
mod unasked;

use super::Dialect;
use super::command::{Command, Framing};
use super::field::Field;
use super::file::File;
use super::overlap::{Fielded, overlap};
use super::template::Template;
use phasmid_core::error::{Error, Result};
use phasmid_core::source::TomlSource;
use std::fmt::Display;

/// Maximum template length.
const MAX_TEMPLATE: usize = 200;

/// A file being checked.
struct Check<'a> {
    source: &'a TomlSource,
    file: &'a File,
}

impl Check<'_> {
    fn that(
        &self,
        ok: bool,
        field: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> Result<()> {
        if ok {
            Ok(())
        } else {
            Err(self.source.violation(field, found, allowed))
        }
    }

    /// Checks that a name consists of letters, digits, underscores and the characters in `more`.
    fn name(&self, field: &str, name: &str, more: &[char]) -> Result<()> {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || more.contains(&c);
        self.that(
            (1..=64).contains(&name.len()) && name.chars().all(plain),
            field,
            format!("{name:?}"),
            more.iter()
                .fold("1 to 64 letters, digits, '_'".to_owned(), |all, c| {
                    format!("{all}, '{c}'")
                }),
        )
    }

    fn template(&self, field: &str, text: &str) -> Result<Template> {
        self.that(
            text.len() <= MAX_TEMPLATE,
            field,
            format!("{} bytes", text.len()),
            format!("{MAX_TEMPLATE} bytes"),
        )?;
        Template::parse(text).map_err(|wrong| {
            let allowed = "text with {name} in it, {{ and }} for braces";
            self.source.violation(field, wrong, allowed)
        })
    }

    /// Checks that every name in a template is one of `known` and occurs at most once.
    fn names(&self, field: &str, template: &Template, known: &[&str]) -> Result<()> {
        let names: Vec<_> = template.names().collect();
        for (at, name) in names.iter().enumerate() {
            self.that(
                known.contains(name) && !names[..at].contains(name),
                field,
                format!("{{{name}}}"),
                match known {
                    [] => "no {name}".to_owned(),
                    known => format!("once each: {}", known.join(", ")),
                },
            )?;
        }
        Ok(())
    }

    /// Returns the location of a field, for messages.
    fn place(&self, field: &str) -> String {
        match self.source.violation(field, "", "") {
            Error::Input { place, .. } => place,
            other => other.to_string(),
        }
    }
}

/// Checks a file.
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

/// Rejects pairs of templates that match the same line.
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

/// Checks that unsolicited lines that the host may receive instead of a reply are distinguishable
/// from it.
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
