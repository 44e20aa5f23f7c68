//! Checks of the host's operations.

use super::fields::{literal, sendable};
use super::reading::Check;
use crate::dialect::command::Command;
use crate::dialect::field::Field;
use crate::dialect::file::OperationFile;
use crate::dialect::uses::{Argument, OPERATIONS, REPORTS};
use crate::dialect::{HostUse, Operation, Step, Value};
use phasmid_core::error::Result;

const MAX_STEPS: usize = 16;

pub(super) fn host(check: &Check<'_>, commands: &[Command]) -> Result<HostUse> {
    let mut host = HostUse::default();
    for (name, file) in &check.file.host {
        let path = format!("host.{name}");
        let known = OPERATIONS.iter().find(|(known, ..)| known == name);
        let Some((_, inputs, has_result)) = known else {
            let names: Vec<_> = OPERATIONS.iter().map(|(name, ..)| *name).collect();
            let found = "an unknown operation";
            return Err(check.source.violation(&path, found, names.join(", ")));
        };
        check.that(
            file.allowed.is_empty() || REPORTS.contains(&name.as_str()),
            &format!("{path}.allowed"),
            "an operation that reports no setting",
            format!("no values, or one of {}", REPORTS.join(", ")),
        )?;
        with_result(check, &path, file, *has_result)?;
        let operation = operation(check, &path, file, inputs, commands)?;
        host.operations.insert(name.clone(), operation);
    }
    for (name, file) in &check.file.settings {
        let path = format!("settings.{name}");
        check.name(&path, name, &['-'])?;
        check.that(
            !OPERATIONS.iter().any(|(known, ..)| known == name),
            &path,
            "the name of an operation",
            format!("another name, or host.{name}"),
        )?;
        with_result(check, &path, file, true)?;
        let operation = operation(check, &path, file, &[], commands)?;
        host.settings.insert(name.clone(), operation);
    }
    Ok(host)
}

/// Checks that an operation that must report something has a result.
fn with_result(check: &Check<'_>, path: &str, file: &OperationFile, wanted: bool) -> Result<()> {
    check.that(
        file.result.is_some() || !wanted,
        &format!("{path}.result"),
        "no result",
        "a text with values of the replies, in braces",
    )
}

fn operation(
    check: &Check<'_>,
    path: &str,
    file: &OperationFile,
    inputs: &[&str],
    commands: &[Command],
) -> Result<Operation> {
    check.that(
        (1..=MAX_STEPS).contains(&file.steps.len()),
        &format!("{path}.steps"),
        format!("{} steps", file.steps.len()),
        format!("1 to {MAX_STEPS}"),
    )?;
    let mut steps = Vec::with_capacity(file.steps.len());
    let mut values: Vec<&str> = Vec::new();
    for (at, step) in file.steps.iter().enumerate() {
        let path = format!("{path}.steps[{at}]");
        let command = commands.iter().find(|command| command.name == step.command);
        let Some(command) = command else {
            let found = format!("{:?}", step.command);
            let place = format!("{path}.command");
            let allowed = "the name of a command of this file";
            return Err(check.source.violation(&place, found, allowed));
        };
        values.extend(command.values.iter().map(|value| value.name.as_str()));
        let args = arguments(check, &path, command, &step.args, inputs)?;
        steps.push(Step {
            command: step.command.clone(),
            args,
        });
    }
    if let Some(result) = &file.result {
        let field = format!("{path}.result");
        let template = check.template(&field, result)?;
        values.dedup();
        check.names(&field, &template, &values)?;
    }
    Ok(Operation {
        steps,
        result: file.result.clone(),
        allowed: file.allowed.clone(),
    })
}

fn arguments(
    check: &Check<'_>,
    path: &str,
    command: &Command,
    given: &std::collections::BTreeMap<String, toml::Value>,
    inputs: &[&str],
) -> Result<Vec<(String, Argument)>> {
    let mut args = Vec::with_capacity(given.len());
    for (name, value) in given {
        let path = format!("{path}.args.{name}");
        let Some(field) = command.arg(name) else {
            let allowed = format!("arguments of {}", command.name);
            return Err(check.source.violation(&path, "not an argument", allowed));
        };
        let value = literal(check, &path, value)?;
        let input = match &value {
            Value::Text(text) => text.strip_prefix('{').and_then(|t| t.strip_suffix('}')),
            _ => None,
        };
        if let Some(input) = input {
            check.that(
                inputs.contains(&input),
                &path,
                format!("{{{input}}}"),
                format!("inputs of this operation: {}", inputs.join(", ")),
            )?;
            args.push((name.clone(), Argument::Input(input.to_owned())));
            continue;
        }
        let wrong = sendable(field, &value);
        check.that(
            wrong.is_none(),
            &path,
            wrong.unwrap_or_default(),
            format!("an argument of {}", command.name),
        )?;
        args.push((name.clone(), Argument::Literal(value)));
    }
    // The host's code supplies the offset argument when it reads a long answer in pieces.
    let counted = |f: &Field| command.chunk.as_ref().is_some_and(|c| c.offset == f.name);
    let missing = command
        .args
        .iter()
        .find(|f| f.constant.is_none() && !given.contains_key(&f.name) && !counted(f));
    check.that(
        missing.is_none(),
        path,
        missing.map_or(String::new(), |f| format!("no {}", f.name)),
        format!("all arguments of {}", command.name),
    )?;
    Ok(args)
}
