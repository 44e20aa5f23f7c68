//! Tests whether some line matches two templates. The test forms the product of two automata whose
//! states are positions in the templates (Hopcroft and Ullman 1979, theorem 3.3). A field is taken
//! to match any number of its allowed characters, so templates that differ only in the range of a
//! number count as overlapping: in doubt a file is rejected.

use super::field::Field;
use super::template::{Part, Template};

enum Symbol {
    One(u8),
    Many(fn(u8) -> bool),
}

fn symbols(template: &Template, fields: &[Field]) -> Vec<Symbol> {
    let mut symbols = Vec::new();
    for part in &template.parts {
        match part {
            Part::Text(text) => symbols.extend(text.bytes().map(Symbol::One)),
            Part::Field(name) => {
                let field = fields.iter().find(|field| field.name == *name);
                symbols.push(Symbol::Many(field.map_or(|_| true, Field::characters)));
            }
        }
    }
    symbols
}

/// A template and the fields that it names.
pub(super) type Fielded<'a> = (&'a Template, &'a [Field]);

/// Returns whether some line matches both templates.
pub(super) fn overlap(a: Fielded<'_>, b: Fielded<'_>, any_case: bool) -> bool {
    let (a, b) = (symbols(a.0, a.1), symbols(b.0, b.1));
    let same = |x: u8, y: u8| {
        if any_case {
            x.eq_ignore_ascii_case(&y)
        } else {
            x == y
        }
    };
    let mut seen = vec![false; (a.len() + 1) * (b.len() + 1)];
    let mut open = vec![(0, 0)];
    while let Some((i, j)) = open.pop() {
        if std::mem::replace(&mut seen[i * (b.len() + 1) + j], true) {
            continue;
        }
        match (a.get(i), b.get(j)) {
            (None, None) => return true,
            (Some(Symbol::One(x)), Some(Symbol::One(y))) => {
                if same(*x, *y) {
                    open.push((i + 1, j + 1));
                }
            }
            (left, right) => {
                if let Some(Symbol::Many(class)) = left {
                    open.push((i + 1, j));
                    if let Some(Symbol::One(y)) = right
                        && (class(*y) || any_case && class(y.to_ascii_uppercase()))
                    {
                        open.push((i, j + 1));
                    }
                }
                if let Some(Symbol::Many(class)) = right {
                    open.push((i, j + 1));
                    if let Some(Symbol::One(x)) = left
                        && (class(*x) || any_case && class(x.to_ascii_uppercase()))
                    {
                        open.push((i + 1, j));
                    }
                }
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_fit_two_templates_are_found() {
        for (a, b, both) in [
            ("exposure {t}", "exposure?", false),
            ("exposure {t}", "EXPOSURE {u}", true),
            ("a{t}", "{t}b", true),
            ("a{t}c", "ab", false),
            ("ok", "ok {t}", false),
            ("{t}", "ok", true),
            ("x {t} y", "x {u}", true),
            ("", "", true),
        ] {
            let (a, b) = (Template::parse(a).unwrap(), Template::parse(b).unwrap());
            assert_eq!(overlap((&a, &[]), (&b, &[]), true), both, "{a:?} {b:?}");
            assert_eq!(overlap((&b, &[]), (&a, &[]), true), both, "{b:?} {a:?}");
        }
    }
}
