//! OpenCV's dialect of XML: elements in `<opencv_storage>`. An element with
//! `type_id="opencv-matrix"` contains `rows`, `cols`, `dt` and `data`; an element without it
//! contains numbers. Other elements are ignored; document type declarations are rejected.
//!
//! An XML crate would replace only the 45 lines that find the tags; its other features (entities,
//! namespaces, types) would have to be rejected here.

use super::node::{Fault, Fields, Nodes, Piece, Value, numbers, quoted};

/// Maximum nesting depth of elements.
const MAX_DEPTH: usize = 64;

/// Parses a text into nodes.
///
/// # Errors
/// Returns an error if tags do not match or the root element is not OpenCV's.
pub(super) fn parse(text: &str) -> Result<Nodes, Fault> {
    let mut reader = Reader {
        rest: text,
        line: 1,
    };
    let mut nodes = Nodes::default();
    // Names of the open elements, outermost first.
    let mut open: Vec<&str> = Vec::new();
    let mut element = Element::default();
    let mut rooted = false;
    while let Some((line, event)) = reader.next()? {
        match event {
            Event::Open {
                name,
                attributes,
                empty,
            } => {
                match open.len() {
                    0 if rooted || name != "opencv_storage" => {
                        let found = format!("<{}>", quoted(name));
                        return Err(Fault::new(line, found, "one <opencv_storage>"));
                    }
                    0 => rooted = true,
                    1 => element = Element::new(line, attributes),
                    MAX_DEPTH.. => {
                        let found = "elements nested too deeply";
                        return Err(Fault::new(line, found, format!("up to {MAX_DEPTH} levels")));
                    }
                    _ => element.has_children = true,
                }
                open.push(name);
                if empty {
                    close(&mut open, name, line, &mut element, &mut nodes)?;
                }
            }
            Event::Close(name) => close(&mut open, name, line, &mut element, &mut nodes)?,
            Event::Text(text) => match (open.len(), open.last()) {
                (2, _) => element.text.push((line, text)),
                (3, Some(&name)) => element.field(name, (line, text)),
                (0, _) if !text.trim().is_empty() => {
                    return Err(Fault::new(
                        line,
                        quoted(text.trim()),
                        "one <opencv_storage>",
                    ));
                }
                _ => {}
            },
        }
    }
    match open.last() {
        Some(name) => {
            let found = format!("the end of the file in <{}>", quoted(name));
            Err(Fault::new(reader.line, found, "a closing tag"))
        }
        None if !rooted => Err(Fault::new(0, "no element", "one <opencv_storage>")),
        None => Ok(nodes),
    }
}

fn close(
    open: &mut Vec<&str>,
    name: &str,
    line: usize,
    element: &mut Element<'_>,
    nodes: &mut Nodes,
) -> Result<(), Fault> {
    match open.pop() {
        Some(opened) if opened == name => {}
        other => {
            return Err(Fault::new(
                line,
                format!("</{}>", quoted(name)),
                other.map_or("no more tags".to_owned(), |o| format!("</{}>", quoted(o))),
            ));
        }
    }
    if open.len() == 1 {
        let element = std::mem::take(element);
        nodes.add(name, element.line, || element.value())?;
    }
    Ok(())
}

/// A child element of the root while it is being read.
#[derive(Debug, Default)]
struct Element<'a> {
    line: usize,
    is_matrix: bool,
    has_children: bool,
    fields: Fields<'a>,
    text: Vec<Piece<'a>>,
}

impl<'a> Element<'a> {
    fn new(line: usize, attributes: &str) -> Self {
        Self {
            line,
            is_matrix: ["\"opencv-matrix\"", "'opencv-matrix'"]
                .iter()
                .any(|kind| attributes.contains(kind)),
            ..Self::default()
        }
    }

    fn field(&mut self, name: &str, text: Piece<'a>) {
        match name {
            "rows" => self.fields.rows = Some(text),
            "cols" => self.fields.cols = Some(text),
            "dt" => self.fields.dt = Some(text),
            // A comment may split the numbers into several pieces.
            "data" => self.fields.data.get_or_insert_default().push(text),
            _ => {}
        }
    }

    fn value(&self) -> Result<Value, Fault> {
        if self.is_matrix {
            return self.fields.matrix(self.line);
        }
        if self.has_children {
            return Err(Fault::new(
                self.line,
                "elements",
                "a number or an opencv-matrix",
            ));
        }
        numbers(&self.text).map(Value::List)
    }
}

enum Event<'a> {
    Open {
        name: &'a str,
        attributes: &'a str,
        empty: bool,
    },
    Close(&'a str),
    Text(&'a str),
}

struct Reader<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Reader<'a> {
    /// Returns the next tag or text and the line on which it begins. Comments and `<?...?>` are
    /// skipped.
    fn next(&mut self) -> Result<Option<(usize, Event<'a>)>, Fault> {
        loop {
            let line = self.line;
            let rest = self.rest;
            if rest.is_empty() {
                return Ok(None);
            }
            if rest.starts_with("<!--") {
                self.until("-->", "a comment")?;
            } else if rest.starts_with("<?") {
                self.until("?>", "a processing instruction")?;
            } else if rest.starts_with("<!") {
                let found = "a document type or CDATA section";
                return Err(Fault::new(line, found, "elements, as OpenCV writes them"));
            } else if rest.starts_with('<') {
                let tag = self.until(">", "a tag")?;
                let inside = &tag[1..tag.len() - 1];
                return Ok(Some((line, event(inside))));
            } else {
                let text = self.take(rest.find('<').unwrap_or(rest.len()));
                return Ok(Some((line, Event::Text(text))));
            }
        }
    }

    /// Consumes text up to and including `end`.
    fn until(&mut self, end: &str, what: &str) -> Result<&'a str, Fault> {
        let at = self.rest.find(end).ok_or_else(|| {
            Fault::new(
                self.line,
                format!("{what} that is not closed"),
                format!("`{end}`"),
            )
        })?;
        Ok(self.take(at + end.len()))
    }

    fn take(&mut self, length: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(length);
        self.line += taken.bytes().filter(|&b| b == b'\n').count();
        self.rest = rest;
        taken
    }
}

/// Interprets the text between the angle brackets of a tag.
fn event(inside: &str) -> Event<'_> {
    if let Some(name) = inside.strip_prefix('/') {
        return Event::Close(name.trim());
    }
    let (inside, empty) = match inside.strip_suffix('/') {
        Some(inside) => (inside, true),
        None => (inside, false),
    };
    let (name, attributes) = inside
        .split_once(|c: char| c.is_whitespace())
        .unwrap_or((inside, ""));
    Event::Open {
        name,
        attributes,
        empty,
    }
}
