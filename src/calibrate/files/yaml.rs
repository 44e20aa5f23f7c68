//! OpenCV's dialect of YAML: unindented `name: value`, where a value is a number, a list `[ 1., 2.
//! ]`, or a matrix, indented under the tag `!!opencv-matrix`. Other content is ignored.
//!
//! A YAML crate would not shorten this module: the first line (`%YAML:1.0`) is not valid YAML and would
//! have to be removed, and finding the fields and numbers with their lines would take as much code.

use super::node::{Fault, Fields, Nodes, Piece, Value, numbers, quoted};

/// Parses a text into nodes.
///
/// # Errors
/// Returns an error if a line neither begins nor continues a node, or if a value is malformed.
pub(super) fn parse(text: &str) -> Result<Nodes, Fault> {
    let mut nodes = Nodes::default();
    let mut lines = (1..).zip(text.lines()).peekable();
    while let Some((line, text)) = lines.next() {
        let blank = text.trim().is_empty() || text.trim_start().starts_with(['#', '%']);
        if blank || text.starts_with("---") || text.starts_with("...") {
            continue;
        }
        let (name, head) = key(text).filter(|_| !belongs(text)).ok_or_else(|| {
            Fault::new(
                line,
                quoted(text.trim()),
                "a line `name: value` of OpenCV's YAML",
            )
        })?;
        let mut body = Vec::new();
        while let Some(&inner) = lines.peek().filter(|(_, next)| belongs(next)) {
            if !inner.1.trim().is_empty() {
                body.push(inner);
            }
            lines.next();
        }
        nodes.add(name, line, || value((line, head), &body))?;
    }
    Ok(nodes)
}

/// Whether a line belongs to the node that began on an earlier line.
fn belongs(line: &str) -> bool {
    line.trim().is_empty()
        || line.starts_with([' ', '\t', '-', ']', '}']) && !line.starts_with("---")
}

/// Splits a line at its first colon.
fn key(line: &str) -> Option<(&str, &str)> {
    let (name, rest) = line.split_once(':')?;
    let name = name.trim().trim_matches(['"', '\'']);
    (!name.is_empty()).then_some((name, uncommented(rest)))
}

/// The text before a comment.
fn uncommented(text: &str) -> &str {
    let text = text.trim();
    match text.starts_with(['"', '\'']) {
        true => text,
        false if text.starts_with('#') => "",
        false => text.split(" #").next().unwrap_or("").trim_end(),
    }
}

fn value(head: Piece<'_>, body: &[Piece<'_>]) -> Result<Value, Fault> {
    let (line, text) = head;
    if text.starts_with('[') {
        return numbers(&flow(head, body)?.0).map(Value::List);
    }
    if text.is_empty() || text == "!!opencv-matrix" {
        return fields(body)?.matrix(line);
    }
    if text.starts_with('!') || text.starts_with('{') {
        return Err(Fault::new(
            line,
            quoted(text),
            "a number or an !!opencv-matrix",
        ));
    }
    numbers(&[head]).map(Value::List)
}

/// Reads a list `[ ... ]` that begins in `head` and may continue over lines of `body`. Returns the
/// pieces of the list and the number of lines of `body` that it spans.
fn flow<'a>(head: Piece<'a>, body: &[Piece<'a>]) -> Result<(Vec<Piece<'a>>, usize), Fault> {
    let mut pieces = Vec::new();
    let first = (head.0, head.1.strip_prefix('[').unwrap_or(head.1));
    for (taken, &(line, text)) in std::iter::once(&first).chain(body).enumerate() {
        let text = uncommented(text);
        if let Some((inside, _)) = text.split_once(']') {
            pieces.push((line, inside));
            return Ok((pieces, taken));
        }
        pieces.push((line, text));
    }
    Err(Fault::new(
        head.0,
        "a list that is not closed",
        "`]` after its last number",
    ))
}

/// Reads the fields of a matrix from the lines below its name.
fn fields<'a>(body: &[Piece<'a>]) -> Result<Fields<'a>, Fault> {
    let mut fields = Fields::default();
    let mut at = 0;
    while let Some(&(line, text)) = body.get(at) {
        at += 1;
        if let Some((name, text)) = key(text) {
            match name {
                "rows" => fields.rows = Some((line, text)),
                "cols" => fields.cols = Some((line, text)),
                "dt" => fields.dt = Some((line, text)),
                "data" if text.starts_with('[') => {
                    let (pieces, taken) = flow((line, text), &body[at..])?;
                    at += taken;
                    fields.data = Some(pieces);
                }
                "data" if text.is_empty() && body.get(at).is_some_and(|next| opens(next.1)) => {
                    let (line, text) = body[at];
                    let (pieces, taken) = flow((line, text.trim_start()), &body[at + 1..])?;
                    at += 1 + taken;
                    fields.data = Some(pieces);
                }
                _ => {}
            }
        }
    }
    Ok(fields)
}

fn opens(line: &str) -> bool {
    line.trim_start().starts_with('[')
}
