//! OpenCV's dialect of JSON: one object whose members are numbers, lists of numbers, or objects
//! with `rows`, `cols`, `dt` and `data`, marked by `"type_id": "opencv-matrix"`. Other members are
//! ignored. Numbers are read exactly, as in the other dialects. OpenCV writes `1.` and `.Nan`,
//! which a strict JSON parser rejects.

use super::node::{Fault, Fields, Nodes, Piece, Value, numbers, quoted};

/// Maximum nesting depth of objects and lists.
const MAX_DEPTH: usize = 64;

/// Parses a text into nodes.
///
/// # Errors
/// Returns an error if members are not separated, brackets do not match, or text follows the
/// object.
pub(super) fn parse(text: &str) -> Result<Nodes, Fault> {
    let mut reader = Reader {
        rest: text,
        line: 1,
    };
    let mut nodes = Nodes::default();
    let (line, object) = reader.value()?;
    if reader.peek().is_some() {
        return Err(Fault::new(
            reader.line,
            reader.line_ahead(),
            "the end of the file after its object",
        ));
    }
    members((line, object), |name, at, piece| {
        nodes.add(name, at, || value(piece))
    })?;
    Ok(nodes)
}

fn value(piece: Piece<'_>) -> Result<Value, Fault> {
    let (line, text) = piece;
    if text.starts_with('{') {
        let mut fields = Fields::default();
        members(piece, |name, _, piece| {
            match name {
                "rows" => fields.rows = Some(piece),
                "cols" => fields.cols = Some(piece),
                "dt" => fields.dt = Some(piece),
                "data" => fields.data = Some(vec![inside(piece)]),
                _ => {}
            }
            Ok(())
        })?;
        return fields.matrix(line);
    }
    numbers(&[inside(piece)]).map(Value::List)
}

/// Returns the text between the brackets of a list; returns a single number unchanged.
fn inside(piece: Piece<'_>) -> Piece<'_> {
    let (line, text) = piece;
    let list = text.strip_prefix('[').and_then(|t| t.strip_suffix(']'));
    (line, list.unwrap_or(text))
}

/// Passes each member of an object to `take`: name, line, and the unparsed value.
fn members<'a>(
    (line, object): Piece<'a>,
    mut take: impl FnMut(&'a str, usize, Piece<'a>) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let mut reader = Reader { rest: object, line };
    reader.expect('{', "an object `{ ... }`")?;
    if reader.peek() == Some('}') {
        return Ok(());
    }
    loop {
        let (line, name) = reader.value()?;
        let name = name
            .strip_prefix('"')
            .and_then(|name| name.strip_suffix('"'))
            .ok_or_else(|| Fault::new(line, quoted(name), "a name in double quotes"))?;
        reader.expect(':', "`:` after a name")?;
        take(name, line, reader.value()?)?;
        if reader.peek() == Some('}') {
            return Ok(());
        }
        reader.expect(',', "`,` or `}` after a value")?;
    }
}

struct Reader<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Reader<'a> {
    /// Skips white space and returns the next character without consuming it.
    fn peek(&mut self) -> Option<char> {
        let blank = self.rest.len() - self.rest.trim_start().len();
        self.take(blank);
        self.rest.chars().next()
    }

    fn expect(&mut self, wanted: char, words: &str) -> Result<(), Fault> {
        match self.peek() {
            Some(found) if found == wanted => {
                self.take(wanted.len_utf8());
                Ok(())
            }
            _ => Err(Fault::new(self.line, self.line_ahead(), words)),
        }
    }

    /// Consumes the next value of any type; returns its text and the line on which it begins.
    fn value(&mut self) -> Result<Piece<'a>, Fault> {
        let first = self.peek();
        let line = self.line;
        let whole = self.rest;
        match first {
            Some('"') => self.string()?,
            Some('{' | '[') => self.balanced()?,
            _ => {
                let apart = |c: char| c.is_whitespace() || ",:{}[]\"".contains(c);
                let length = self.rest.find(apart).unwrap_or(self.rest.len());
                self.take(length);
            }
        }
        let text = &whole[..whole.len() - self.rest.len()];
        if text.is_empty() {
            return Err(Fault::new(line, self.line_ahead(), "a name or a value"));
        }
        Ok((line, text))
    }

    /// Consumes an object or a list with its contents.
    fn balanced(&mut self) -> Result<(), Fault> {
        let first = self.line;
        let mut open: Vec<char> = Vec::new();
        while let Some(at) = self.rest.find(['{', '[', '}', ']', '"']) {
            self.take(at);
            let Some(bracket) = self.rest.chars().next() else {
                break;
            };
            match bracket {
                '"' => {
                    self.string()?;
                    continue;
                }
                '{' | '[' if open.len() == MAX_DEPTH => {
                    let found = "lists nested too deeply";
                    return Err(Fault::new(
                        self.line,
                        found,
                        format!("up to {MAX_DEPTH} levels"),
                    ));
                }
                '{' => open.push('}'),
                '[' => open.push(']'),
                _ => match open.pop() {
                    Some(wanted) if wanted == bracket => {}
                    wanted => {
                        let wanted = wanted.unwrap_or('{');
                        return Err(Fault::new(
                            self.line,
                            format!("`{bracket}`"),
                            format!("`{wanted}`"),
                        ));
                    }
                },
            }
            self.take(1);
            if open.is_empty() {
                return Ok(());
            }
        }
        Err(Fault::new(
            first,
            "a bracket that is not closed",
            format!("`{}` after it", open.last().unwrap_or(&'}')),
        ))
    }

    /// Consumes a string with its quotes.
    fn string(&mut self) -> Result<(), Fault> {
        let mut escaped = false;
        for (at, byte) in self.rest.bytes().enumerate().skip(1) {
            match byte {
                b'\n' => break,
                _ if escaped => escaped = false,
                b'\\' => escaped = true,
                b'"' => {
                    self.take(at + 1);
                    return Ok(());
                }
                _ => {}
            }
        }
        let found = "a string that is not closed";
        Err(Fault::new(self.line, found, "`\"` on the same line"))
    }

    /// The rest of the line, for a message.
    fn line_ahead(&self) -> String {
        match self.rest.lines().next() {
            Some(line) => quoted(line),
            None => "the end of the file".to_owned(),
        }
    }

    fn take(&mut self, length: usize) {
        let (taken, rest) = self.rest.split_at(length);
        self.line += taken.bytes().filter(|&b| b == b'\n').count();
        self.rest = rest;
    }
}
