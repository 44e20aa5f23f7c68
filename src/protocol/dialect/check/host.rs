//! Checks of the host's operations.

use super::Check;
use super::fields::number_or_text;
use crate::dialect::command::Command;
use crate::dialect::field::Field;
use crate::dialect::uses::{Argument, OPERATIONS};
use crate::dialect::{HostUse, Operation, Step, Value};
use phasmid_core::error::Result;

const MAX_STEPS: usize = 16;

pub(super) fn host(check: &Check<'_>, commands: &[Command]) -> Result<HostUse> {
    let mut host = HostUse::default();
    for (name, file) in &check.file.host {
        let path = format!("host.{name}");
        let known = OPERATIONS.iter().find(|(known, _)| known == name);
        let Some((_, inputs)) = known else {
            let names: Vec<_> = OPERATIONS.iter().map(|(name, _)| *name).collect();
            let found = "an unknown operation";
            return Err(check.source.violation(&path, found, names.join(", ")));
        };
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
        let operation = Operation {
            steps,
            result: file.result.clone(),
        };
        host.operations.insert(name.clone(), operation);
    }
    Ok(host)
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
    // The code that reads a long answer supplies its offset.
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

pub(super) fn sendable(field: &Field, value: &Value) -> Option<String> {
    let sent = match field.kind.in_packets() && !field.kind.in_lines() {
        true => field.to_packet(value, &mut Vec::new()).err(),
        false => field.to_line(value).err(),
    };
    sent.map(|error| error.to_string())
}

/// Converts a number or a text to a value.
pub(super) fn literal(check: &Check<'_>, path: &str, value: &toml::Value) -> Result<Value> {
    number_or_text(value).ok_or_else(|| {
        let found = value.type_str();
        check.source.violation(path, found, "a number or a text")
    })
}
