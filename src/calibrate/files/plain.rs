//! SLStudio's text formats: `.slcalib`, a name on a line and its numbers below it, and `.m`,
//! `Kc = [1, 0, 2; ...];`. Comments begin with `#` or `%`.

use super::node::{Fault, Nodes, Value};
use super::number::number;

/// The nodes of a text: names, and the numbers after each.
///
/// # Errors
/// A name for the second time.
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
