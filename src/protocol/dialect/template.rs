//! Templates with `{name}` placeholders: formatted in one direction, parsed in the other.
//!
//! A `{name}` ends at the first occurrence of the text that follows it; a `{name}` at the end of
//! the template takes the rest of the line. Parsing is therefore unambiguous and needs no
//! backtracking. Quoted strings and blocks (IEEE 488.2, 7.7.5 and 7.7.6) determine their own end.

use crate::scpi::{BlockPrefix, block_header};

/// A piece of a template.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Part {
    /// Literal text.
    Text(String),
    /// Name of a field.
    Field(String),
}

/// A text with `{name}` placeholders; `{{` and `}}` are literal braces.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Template {
    pub(super) parts: Vec<Part>,
}

impl Template {
    /// Parses a template.
    ///
    /// # Errors
    /// Returns an error that describes the defect.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut parts = Vec::new();
        let mut plain = String::new();
        let mut chars = text.chars().peekable();
        while let Some(c) = chars.next() {
            match c {
                '{' | '}' if chars.peek() == Some(&c) => {
                    chars.next();
                    plain.push(c);
                }
                '{' => {
                    let mut name = String::new();
                    loop {
                        match chars.next() {
                            Some('}') => break,
                            Some(c) if c.is_ascii_alphanumeric() || c == '_' => name.push(c),
                            Some(c) => return Err(format!("{c:?} in the name after {{{name}")),
                            None => return Err(format!("{{{name} without a closing brace")),
                        }
                    }
                    if name.is_empty() {
                        return Err("{} without a name".to_owned());
                    }
                    if !plain.is_empty() {
                        parts.push(Part::Text(std::mem::take(&mut plain)));
                    } else if matches!(parts.last(), Some(Part::Field(_))) {
                        return Err(format!(
                            "no text between {{{name}}} and the field before it"
                        ));
                    }
                    parts.push(Part::Field(name));
                }
                '}' => return Err("} without {".to_owned()),
                c if c.is_control() => return Err(format!("the control character {c:?}")),
                c => plain.push(c),
            }
        }
        if !plain.is_empty() {
            parts.push(Part::Text(plain));
        }
        Ok(Self { parts })
    }

    /// Returns the field names in order of appearance.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.parts.iter().filter_map(|part| match part {
            Part::Field(name) => Some(name.as_str()),
            Part::Text(_) => None,
        })
    }

    /// Returns the text with each placeholder replaced by the result of `value`.
    ///
    /// # Errors
    /// Returns an error if `value` fails, or if a value could not be distinguished from the template
    /// text that follows it.
    pub(super) fn fill<E: From<String>>(
        &self,
        mut value: impl FnMut(&str) -> Result<Vec<u8>, E>,
    ) -> Result<Vec<u8>, E> {
        let mut line = Vec::new();
        for (i, part) in self.parts.iter().enumerate() {
            match part {
                Part::Text(text) => line.extend_from_slice(text.as_bytes()),
                Part::Field(name) => {
                    let value = value(name)?;
                    if let Some(Part::Text(next)) = self.parts.get(i + 1)
                        && own_end(&value) != Some(value.len())
                        && find(&value, next.as_bytes(), true).is_some()
                    {
                        return Err(E::from(format!("{next:?} is not allowed in {name}")));
                    }
                    line.extend_from_slice(&value);
                }
            }
        }
        Ok(line)
    }

    /// Parses a line; `None` if it does not match the template.
    pub(super) fn split<'a>(
        &'a self,
        line: &'a [u8],
        any_case: bool,
    ) -> Option<Vec<(&'a str, &'a [u8])>> {
        let mut found = Vec::new();
        let mut rest = line;
        for (i, part) in self.parts.iter().enumerate() {
            match part {
                Part::Text(text) => {
                    let (head, tail) = rest.split_at_checked(text.len())?;
                    if !same(head, text.as_bytes(), any_case) {
                        return None;
                    }
                    rest = tail;
                }
                Part::Field(name) => {
                    let end = match self.parts.get(i + 1) {
                        _ if own_end(rest).is_some() => own_end(rest)?,
                        Some(Part::Text(next)) => find(rest, next.as_bytes(), any_case)?,
                        _ => rest.len(),
                    };
                    let (value, tail) = rest.split_at_checked(end)?;
                    found.push((name.as_str(), value));
                    rest = tail;
                }
            }
        }
        rest.is_empty().then_some(found)
    }
}

fn same(a: &[u8], b: &[u8], any_case: bool) -> bool {
    if any_case {
        a.eq_ignore_ascii_case(b)
    } else {
        a == b
    }
}

fn find(text: &[u8], what: &[u8], any_case: bool) -> Option<usize> {
    text.windows(what.len().max(1))
        .position(|window| same(window, what, any_case))
}

/// Returns the position after the block, or after the list of quoted strings, at the start of
/// `bytes`.
pub(super) fn own_end(bytes: &[u8]) -> Option<usize> {
    match bytes.first()? {
        b'#' => match block_header(bytes) {
            BlockPrefix::Block { prefix, len } if bytes.len() - prefix >= len => Some(prefix + len),
            _ => None,
        },
        b'"' => {
            let mut quoted = false;
            for (at, byte) in bytes.iter().enumerate() {
                match byte {
                    b'"' => quoted = !quoted,
                    b',' if bytes.get(at + 1) == Some(&b'"') => {}
                    _ if !quoted => return Some(at),
                    _ => {}
                }
            }
            (!quoted).then_some(bytes.len())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split<'a>(template: &'a Template, line: &'a str) -> Option<Vec<(&'a str, &'a str)>> {
        let parts = template.split(line.as_bytes(), true)?;
        let text = |bytes| std::str::from_utf8(bytes).unwrap();
        Some(parts.into_iter().map(|(n, v)| (n, text(v))).collect())
    }

    #[test]
    fn lines_are_taken_apart_in_one_way() {
        let template = Template::parse("M240 S{us} {{{text}}}").unwrap();
        assert_eq!(
            split(&template, "m240 s80 {a b}"),
            Some(vec![("us", "80"), ("text", "a b")])
        );
        for other in ["M240 S80", "M240 80 {a}", "M240 S80 {a} x", ""] {
            assert_eq!(split(&template, other), None, "{other}");
        }
        let template = Template::parse("{a},{b}").unwrap();
        assert_eq!(
            split(&template, "1,2,3"),
            Some(vec![("a", "1"), ("b", "2,3")])
        );
        let quoted = "\"x,y\"\"\",\"z\"";
        let line = format!("{quoted},7");
        assert_eq!(
            split(&template, &line),
            Some(vec![("a", quoted), ("b", "7")])
        );
        assert_eq!(
            split(&template, "#13a,b,c"),
            Some(vec![("a", "#13a,b"), ("b", "c")])
        );
    }

    #[test]
    fn refuses_values_that_would_not_read_back() {
        let template = Template::parse("{a},{b}").unwrap();
        let fill = |a: &str| {
            template.fill(|name| Ok::<_, String>(if name == "a" { a } else { "," }.into()))
        };
        assert_eq!(fill("x").unwrap(), b"x,,");
        assert!(fill("x,").unwrap_err().contains("is not allowed in a"));
        assert_eq!(fill("\"x,\"").unwrap(), b"\"x,\",,");
    }

    #[test]
    fn refuses_invalid_templates() {
        for (text, needle) in [
            ("{", "without a closing brace"),
            ("}", "} without {"),
            ("{}", "without a name"),
            ("{a b}", "' ' in the name"),
            ("{a}{b}", "no text between"),
            ("a\n", "control"),
        ] {
            let words = Template::parse(text).unwrap_err();
            assert!(words.contains(needle), "{text}: {words}");
        }
    }
}
