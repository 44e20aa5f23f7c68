//! A dialect file being checked, and the errors for violations found in it.

use crate::dialect::file::File;
use crate::dialect::template::Template;
use phasmid_core::error::{Error, Result};
use phasmid_core::source::TomlSource;
use std::fmt::Display;

/// Maximum length of a template in bytes.
const MAX_TEMPLATE: usize = 200;

/// A dialect file being checked.
pub(super) struct Check<'a> {
    pub(super) source: &'a TomlSource,
    pub(super) file: &'a File,
}

impl Check<'_> {
    pub(super) fn that(
        &self,
        ok: bool,
        field: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> Result<()> {
        if ok {
            Ok(())
        } else {
            Err(self.source.violation(field, found, allowed))
        }
    }

    /// Checks that a name consists of letters, digits, underscores and the characters in `more`.
    pub(super) fn name(&self, field: &str, name: &str, more: &[char]) -> Result<()> {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || more.contains(&c);
        self.that(
            (1..=64).contains(&name.len()) && name.chars().all(plain),
            field,
            format!("{name:?}"),
            more.iter()
                .fold("1 to 64 letters, digits, '_'".to_owned(), |all, c| {
                    format!("{all}, '{c}'")
                }),
        )
    }

    pub(super) fn template(&self, field: &str, text: &str) -> Result<Template> {
        self.that(
            text.len() <= MAX_TEMPLATE,
            field,
            format!("{} bytes", text.len()),
            format!("{MAX_TEMPLATE} bytes"),
        )?;
        Template::parse(text).map_err(|wrong| {
            let allowed = "text with {name} in it, {{ and }} for braces";
            self.source.violation(field, wrong, allowed)
        })
    }

    /// Checks that every name in a template is one of `known` and occurs at most once.
    pub(super) fn names(&self, field: &str, template: &Template, known: &[&str]) -> Result<()> {
        let names: Vec<_> = template.names().collect();
        for (at, name) in names.iter().enumerate() {
            self.that(
                known.contains(name) && !names[..at].contains(name),
                field,
                format!("{{{name}}}"),
                match known {
                    [] => "no {name}".to_owned(),
                    known => format!("once each: {}", known.join(", ")),
                },
            )?;
        }
        Ok(())
    }

    /// Returns the location of a field, for messages.
    pub(super) fn place(&self, field: &str) -> String {
        match self.source.violation(field, "", "") {
            Error::Input { place, .. } => place,
            other => other.to_string(),
        }
    }
}
