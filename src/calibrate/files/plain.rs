//! SLStudio's text formats: `.slcalib` (a name on a line, its numbers below) and `.m` (`Kc = [1, 0,
//! 2; ...];`). Comments begin with `#` or `%`.

use super::node::{Fault, Nodes, Value};
use super::number::number;

/// Parses a text into nodes: names, each with the numbers that follow.
///
/// # Errors
/// Returns an error if a name occurs twice.
pub(super) fn parse(text: &str) -> Result<Nodes, Fault> {
    let mut nodes = Nodes::default();
    let mut open: Option<(&str, usize, Vec<f64>)> = None;
    let mut keep = |open: Option<(&str, usize, Vec<f64>)>| match open {
        Some((name, line, list)) => nodes.add(name, line, || Ok(Value::List(list))),
        None => Ok(()),
    };
    for (line, text) in (1..).zip(text.lines()) {
        let text = text.split(['#', '%']).next().unwrap_or("");
        let apart = |c: char| c.is_whitespace() || ",;=[]:".contains(c);
        for word in text.split(apart).filter(|word| !word.is_empty()) {
            match (number(word), &mut open) {
                (Some(value), Some((_, _, list))) => list.push(value),
                (Some(_), None) => {}
                (None, _) => keep(open.replace((word, line, Vec::new())))?,
            }
        }
    }
    keep(open)?;
    Ok(nodes)
}
