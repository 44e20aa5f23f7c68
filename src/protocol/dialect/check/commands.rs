//! Checks of commands: requests, firmware messages and replies.

use super::fields::fields;
use super::reading::Check;
use crate::dialect::Value;
use crate::dialect::command::{Command, Framing};
use crate::dialect::field::{Field, Kind};
use crate::dialect::file::{ChunkFile, CommandFile};
use crate::dialect::template::Template;
use crate::dialect::{Chunk, Direction};
use crate::scpi::parse;
use phasmid_core::error::Result;

const MAX_COMMANDS: usize = 128;
/// Maximum number of firmware messages, and maximum number of reply lines, of a command.
const MAX_PARTS: usize = 16;

pub(super) fn commands(check: &Check<'_>, framing: &Framing) -> Result<Vec<Command>> {
    let files = &check.file.command;
    check.that(
        (1..=MAX_COMMANDS).contains(&files.len()),
        "command",
        format!("{} commands", files.len()),
        format!("1 to {MAX_COMMANDS}"),
    )?;
    let mut commands: Vec<Command> = Vec::with_capacity(files.len());
    for (at, file) in files.iter().enumerate() {
        let path = format!("command[{at}]");
        check.name(&format!("{path}.name"), &file.name, &['?', '-'])?;
        let taken = commands.iter().any(|other| other.name == file.name);
        check.that(
            !taken,
            &format!("{path}.name"),
            format!("{:?}, which is already used", file.name),
            "a unique name",
        )?;
        let command = command(check, framing, &path, file)?;
        if let Framing::Packet(_) = framing {
            let same = |other: &&Command| (other.code, other.read) == (command.code, command.read);
            if let Some(other) = commands.iter().find(same) {
                let found = format!("{:#06x}, which {} has", command.code, other.name);
                let allowed = "a unique code, or one to read and one to write";
                check.that(false, &format!("{path}.code"), found, allowed)?;
            }
        }
        commands.push(command);
    }
    Ok(commands)
}

fn command(
    check: &Check<'_>,
    framing: &Framing,
    path: &str,
    file: &CommandFile,
) -> Result<Command> {
    let at = |name: &str| format!("{path}.{name}");
    let args = fields(check, framing, &at("args"), &file.args)?;
    let values = fields(check, framing, &at("values"), &file.values)?;
    let mut command = Command {
        name: file.name.clone(),
        line: Template { parts: Vec::new() },
        code: file.code.unwrap_or(0),
        read: file.read,
        args,
        runs: Vec::new(),
        answers: Vec::new(),
        values,
        reply: Vec::new(),
        chunk: None,
        chunk_bytes: 0,
    };
    match framing {
        Framing::Packet(layout) => {
            check.that(
                file.line.is_none() && file.reply.is_none(),
                path,
                "lines",
                "code, args and values in packets",
            )?;
            let most = u32::MAX >> (32 - 8 * layout.code.bytes as u32);
            check.that(
                file.code.is_some_and(|code| code <= most),
                &at("code"),
                file.code
                    .map_or("none".to_owned(), |code| format!("{code:#x}")),
                format!("0 to {most:#x}"),
            )?;
            check.that(
                !file.read || layout.flags.is_some_and(|flags| flags.read.is_some()),
                &at("read"),
                "true",
                "a packet with flags = { at, read }",
            )?;
            for (name, fields, direction) in [
                ("args", &command.args, Direction::ToDevice),
                ("values", &command.values, Direction::ToHost),
            ] {
                let size = |f: &Field| f.kind.width().or(f.bytes).unwrap_or(0);
                let needed: usize = fields.iter().map(size).sum();
                let room = layout.room(direction);
                check.that(
                    needed <= room,
                    &at(name),
                    format!("{needed} bytes"),
                    format!("{room} bytes of a packet's data"),
                )?;
            }
        }
        Framing::Line(_) | Framing::Scpi(_) => {
            check.that(
                file.code.is_none() && !file.read,
                path,
                "a packet's code or read",
                "line = TEXT in lines",
            )?;
            let text = file.line.as_deref().unwrap_or("");
            check.that(
                !text.trim().is_empty() && text.trim() == text,
                &at("line"),
                format!("{text:?}"),
                "a line without spaces at its ends",
            )?;
            command.line = check.template(&at("line"), text)?;
            all_named(check, &at("line"), &[&command.line], &command.args)?;
            command.reply = reply(check, framing, path, file)?;
        }
    }
    command.chunk = file
        .chunk
        .as_ref()
        .map(|chunk| chunked(check, framing, path, chunk, &command))
        .transpose()?;
    command.chunk_bytes = file.chunk.as_ref().map_or(0, |chunk| chunk.bytes);
    actions(check, framing, path, file, &mut command)?;
    Ok(command)
}

/// Checks that the templates contain every field exactly once and nothing else.
fn all_named(
    check: &Check<'_>,
    path: &str,
    templates: &[&Template],
    fields: &[Field],
) -> Result<()> {
    let known: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
    for template in templates {
        check.names(path, template, &known)?;
    }
    for name in known {
        let times = templates
            .iter()
            .flat_map(|t| t.names())
            .filter(|n| *n == name);
        let times = times.count();
        check.that(
            times == 1,
            path,
            format!("{{{name}}} {times} times"),
            "each argument or value once",
        )?;
    }
    Ok(())
}

fn reply(
    check: &Check<'_>,
    framing: &Framing,
    path: &str,
    file: &CommandFile,
) -> Result<Vec<Template>> {
    let field = format!("{path}.reply");
    let ok = check.file.line.as_ref().and_then(|line| line.ok.clone());
    let lines = match (&file.reply, ok, framing) {
        (Some(lines), ..) => lines.clone(),
        (None, Some(ok), Framing::Line(_)) => vec![ok],
        _ => Vec::new(),
    };
    // An instrument answers a message with one line (IEEE 488.2, 8.3).
    let most = match framing {
        Framing::Scpi(_) => 1,
        _ => MAX_PARTS,
    };
    check.that(
        lines.len() <= most,
        &field,
        format!("{} lines", lines.len()),
        format!("up to {most}"),
    )?;
    let mut templates = Vec::with_capacity(lines.len());
    for (at, line) in lines.iter().enumerate() {
        let field = format!("{field}[{at}]");
        check.that(
            !line.trim().is_empty() && line.trim() == line,
            &field,
            format!("{line:?}"),
            "a line without spaces at its ends",
        )?;
        templates.push(check.template(&field, line)?);
    }
    let all: Vec<&Template> = templates.iter().collect();
    let known: Vec<&str> = file
        .values
        .iter()
        .map(|value| value.name.as_str())
        .collect();
    for name in &known {
        let times = all
            .iter()
            .flat_map(|t| t.names())
            .filter(|n| n == name)
            .count();
        check.that(
            times == 1,
            &field,
            format!("{{{name}}} {times} times"),
            "each value once",
        )?;
    }
    for template in all {
        check.names(&field, template, &known)?;
    }
    Ok(templates)
}

fn chunked(
    check: &Check<'_>,
    framing: &Framing,
    path: &str,
    chunk: &ChunkFile,
    command: &Command,
) -> Result<Chunk> {
    let path = format!("{path}.chunk");
    let plain = |f: &Field| f.kind.is_number() && f.choices.is_empty() && f.divisor == 1.0;
    let offset = command.arg(&chunk.offset).is_some_and(plain);
    let data = command
        .value(&chunk.data)
        .is_some_and(|f| f.kind.is_bytes());
    let total = command.value(&chunk.total).is_some_and(plain);
    let check_ok = chunk.check.as_ref().is_none_or(|name| {
        let wide = |f: &Field| plain(f) && f.range.1 >= f64::from(u32::MAX);
        command.value(name).is_some_and(wide)
    });
    for (ok, name, found, allowed) in [
        (
            offset,
            "offset",
            &chunk.offset,
            "an argument that is a plain number",
        ),
        (data, "data", &chunk.data, "a value that is bytes"),
        (
            total,
            "total",
            &chunk.total,
            "a value that is a plain number",
        ),
        (
            check_ok,
            "check",
            chunk.check.as_ref().unwrap_or(&chunk.data),
            "a value that is a plain number of 32 bits",
        ),
    ] {
        check.that(ok, &format!("{path}.{name}"), format!("{found:?}"), allowed)?;
    }
    let most = match framing {
        Framing::Packet(layout) => {
            let others: usize = command.values.iter().filter_map(|f| f.kind.width()).sum();
            layout.room(Direction::ToHost).saturating_sub(others)
        }
        // Data takes two hexadecimal digits per byte; the reserve of 256 characters is for the
        // template and its numbers.
        Framing::Line(ends) => ends.max.saturating_sub(256) / 2,
        Framing::Scpi(_) => 0,
    };
    check.that(
        (1..=most).contains(&chunk.bytes),
        &format!("{path}.bytes"),
        chunk.bytes,
        format!("1 to {most}, the capacity of a message"),
    )?;
    Ok(Chunk {
        offset: chunk.offset.clone(),
        data: chunk.data.clone(),
        total: chunk.total.clone(),
        check: chunk.check.clone(),
    })
}

/// Checks the firmware messages of a command, and the source of its reply values.
fn actions(
    check: &Check<'_>,
    framing: &Framing,
    path: &str,
    file: &CommandFile,
    command: &mut Command,
) -> Result<()> {
    let at = |name: &str| format!("{path}.{name}");
    if let Framing::Scpi(_) = framing {
        return check.that(
            file.runs.is_empty() && file.answers.is_empty() && file.chunk.is_none(),
            path,
            "runs, answers or chunk in SCPI",
            "line, args, reply and values: the device itself speaks SCPI",
        );
    }
    for (name, parts) in [("runs", &file.runs), ("answers", &file.answers)] {
        check.that(
            parts.len() <= MAX_PARTS,
            &at(name),
            format!("{} of them", parts.len()),
            format!("up to {MAX_PARTS}"),
        )?;
    }
    check.that(
        file.answers.len() <= file.runs.len(),
        &at("answers"),
        format!("{} for {} runs", file.answers.len(), file.runs.len()),
        "at most one for each message of runs",
    )?;
    let sent = |field: &&Field| field.constant.is_none() && !field.kind.is_bytes();
    let known: Vec<&str> = command
        .args
        .iter()
        .filter(sent)
        .map(|f| f.name.as_str())
        .collect();
    for (i, run) in file.runs.iter().enumerate() {
        let field = format!("{path}.runs[{i}]");
        let template = check.template(&field, run)?;
        check.names(&field, &template, &known)?;
        command.runs.push(template);
    }
    let known: Vec<&str> = command.values.iter().map(|f| f.name.as_str()).collect();
    let mut sources: Vec<String> = Vec::new();
    for (i, answer) in file.answers.iter().enumerate() {
        let field = format!("{path}.answers[{i}]");
        let template = check.template(&field, answer)?;
        check.names(&field, &template, &known)?;
        sources.extend(template.names().map(str::to_owned));
        command
            .answers
            .push((!answer.is_empty()).then_some(template));
    }
    if let Some(chunk) = &command.chunk {
        sources.push(chunk.total.clone());
        sources.extend(chunk.check.clone());
    }
    let constant = command.values.iter().filter(|f| f.constant.is_some());
    sources.extend(constant.map(|f| f.name.clone()));
    for (i, value) in command.values.iter().enumerate() {
        let times = sources.iter().filter(|name| **name == value.name).count();
        check.that(
            times == 1,
            &format!("{path}.values[{i}]"),
            format!("{}, which has {times} sources", value.name),
            "one of: answers, chunk, constant",
        )?;
    }
    Ok(())
}

/// Returns every message for the firmware with example arguments, after a check of its grammar.
pub(super) fn runs(check: &Check<'_>, commands: &[Command]) -> Result<Vec<(String, String)>> {
    let mut all = Vec::new();
    for (at, command) in commands.iter().enumerate() {
        for (i, run) in command.runs.iter().enumerate() {
            let field = format!("command[{at}].runs[{i}]");
            let place = check.place(&field);
            for message in examples(command, run) {
                let program = parse(message.as_bytes());
                let wrong = program.error.map(|error| error.to_string());
                let wrong = wrong.or(program.units.is_empty().then(|| "nothing".to_owned()));
                check.that(
                    wrong.is_none(),
                    &field,
                    format!("{message:?}: {}", wrong.unwrap_or_default()),
                    "a message in the device's own language, SCPI",
                )?;
                all.push((message, place.clone()));
            }
        }
    }
    Ok(all)
}

/// Returns firmware messages of a command with example arguments: one message for each choice of
/// each argument, while the other arguments have example values.
fn examples(command: &Command, run: &Template) -> Vec<String> {
    let filled = |chosen: Option<(&str, &str)>| {
        let message = run.fill(|name| {
            let field = command.arg(name).ok_or_else(String::new)?;
            let value = match chosen {
                Some((own, word)) if own == name => Value::Text(word.to_owned()),
                _ => field.example(),
            };
            let text = field.to_scpi(&value).map_err(|error| error.to_string())?;
            Ok::<_, String>(text.into_bytes())
        });
        String::from_utf8(message.unwrap_or_default()).unwrap_or_default()
    };
    let mut messages = vec![filled(None)];
    for name in run.names() {
        let choices = command.arg(name).map_or(&[][..], |field| &field.choices);
        let each = choices.iter().map(|(_, word)| filled(Some((name, word))));
        messages.extend(each);
    }
    messages.sort();
    messages.dedup();
    messages
}

/// Returns whether a packet's error number may have this type.
pub(super) fn is_error_number(kind: Kind) -> bool {
    kind.width().is_some() && kind != Kind::F32
}
