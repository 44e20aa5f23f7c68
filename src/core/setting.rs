//! Settings: values for single fields of a document.

use crate::error::{Error, Result};
use std::fmt::Display;
use std::str::FromStr;

/// Maximum number of steps of a path. It bounds the recursion in which nested values are written
/// and dropped.
const MAX_STEPS: usize = 64;

/// A value for a field of a document, such as `camera.sensor.read_noise_e=5`: the path of the field
/// and a TOML value; a text that is not valid TOML is taken as a string.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    pub(crate) path: String,
    pub(crate) value: String,
    origin: String,
}

impl Setting {
    /// Creates a setting from a path such as `object[0].position_mm` and a TOML value. An invalid path
    /// is reported when a document is read with the setting.
    pub fn new(path: impl Into<String>, value: impl Display) -> Self {
        Self {
            path: path.into(),
            value: value.to_string(),
            origin: "setting".to_owned(),
        }
    }

    /// Sets the origin of the setting for messages, such as a command-line option. The default
    /// origin is "setting".
    #[must_use]
    pub fn given_by(mut self, origin: &str) -> Self {
        origin.clone_into(&mut self.origin);
        self
    }

    /// Returns the place of the setting in messages: its origin and its text.
    pub fn place(&self) -> String {
        format!("{} {self}", self.origin)
    }

    /// Returns the first key of the path.
    pub fn section(&self) -> &str {
        self.path.split(['.', '[']).next().unwrap_or_default()
    }
}

impl FromStr for Setting {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused =
            |(found, expected): (String, String)| Error::input("setting", found, expected);
        let Some((path, value)) = text.split_once('=') else {
            return Err(refused((
                format!("{text:?}"),
                "FIELD=VALUE, such as camera.sensor.read_noise_e=5".to_owned(),
            )));
        };
        let setting = Self::new(path.trim(), value.trim());
        steps(&setting.path).map_err(refused)?;
        Ok(setting)
    }
}

impl Display for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.path, self.value)
    }
}

/// A step of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step<'a> {
    Key(&'a str),
    Index(usize),
}

/// Splits a path such as `object[0].position_mm`. An error consists of the value found and the expected
/// form.
pub(crate) fn steps(path: &str) -> Result<Vec<Step<'_>>, (String, String)> {
    let mut steps = Vec::new();
    for part in path.split('.') {
        let (key, indices) = part.split_at(part.find('[').unwrap_or(part.len()));
        if key.is_empty() {
            return Err((
                format!("an empty name in {path:?}"),
                "names joined by single dots, such as camera.sensor.read_noise_e".to_owned(),
            ));
        }
        let is_key = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
        if let Some(wrong) = key.chars().find(|&c| !is_key(c)) {
            return Err((
                format!("{wrong:?} in the name {key:?}"),
                "a name of letters, digits, '-' and '_'".to_owned(),
            ));
        }
        steps.push(Step::Key(key));
        let mut rest = indices;
        while !rest.is_empty() {
            let bracket = || {
                (
                    format!("{part:?}"),
                    format!("an index in brackets, such as {key}[0]"),
                )
            };
            let inner = rest.strip_prefix('[').ok_or_else(bracket)?;
            let (index, after) = inner.split_once(']').ok_or_else(bracket)?;
            steps.push(Step::Index(index.parse().map_err(|_| bracket())?));
            rest = after;
        }
        if steps.len() > MAX_STEPS {
            return Err((
                format!("a path of more than {MAX_STEPS} steps"),
                "the path of a field".to_owned(),
            ));
        }
    }
    Ok(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_split_into_steps() {
        assert_eq!(
            steps("a[0][12].b-c"),
            Ok(vec![
                Step::Key("a"),
                Step::Index(0),
                Step::Index(12),
                Step::Key("b-c")
            ])
        );
        let setting: Setting = " sequence[0].name = x=y ".parse().unwrap();
        assert_eq!(setting, Setting::new("sequence[0].name", "x=y"));
        assert_eq!(setting.section(), "sequence");
        assert_eq!(setting.place(), "setting sequence[0].name=x=y");
        let place = setting.given_by("--set").place();
        assert_eq!(place, "--set sequence[0].name=x=y");
    }

    #[test]
    fn wrong_paths_have_one_message_each() {
        let deep = format!("camera{}=1", ".a".repeat(60_000));
        for (text, found) in [
            ("camera", "\"camera\"; expected FIELD=VALUE"),
            ("=2", "an empty name in \"\"; expected names joined"),
            ("camera..x=2", "an empty name in \"camera..x\""),
            (".x=2", "an empty name in \".x\""),
            ("x.=2", "an empty name in \"x.\""),
            ("[0]=2", "an empty name in \"[0]\""),
            (
                "sequence[0=2",
                "\"sequence[0\"; expected an index in brackets, such as sequence[0]",
            ),
            ("a[]=2", "\"a[]\"; expected an index in brackets"),
            ("a[x]=2", "\"a[x]\"; expected an index in brackets"),
            ("a[0]b=2", "\"a[0]b\"; expected an index in brackets"),
            ("a]=2", "']' in the name \"a]\""),
            ("a b=2", "' ' in the name \"a b\""),
            (&deep, "a path of more than 64 steps"),
        ] {
            let message = text.parse::<Setting>().unwrap_err().to_string();
            assert!(
                message.starts_with(&format!("setting: {found}")),
                "{message}"
            );
        }
    }
}
