//! Rows: the results of a trial, by column name.

/// Values by name. They are stored as text, so that a row read from a file equals the written one:
/// numbers have as many digits as it takes to restore them exactly.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Row {
    values: Vec<(String, String)>,
}

impl Row {
    /// The first columns of the rows of all studies: the trial, the index of the row in the trial and
    /// the trial's number of rows, its seed, the backend (`cpu` or `gpu`), the GPU adapter, the
    /// program's version and revision, the machine's architecture and system, the number of threads,
    /// and the trial's duration in seconds.
    pub const COMMON: [&str; 11] = [
        "trial", "part", "parts", "seed", "backend", "adapter", "version", "revision", "target",
        "threads", "seconds",
    ];

    /// Makes a row without values.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets a number. A number that is not finite is stored as empty text.
    #[must_use]
    pub fn number(self, name: &str, value: f64) -> Self {
        let text = if value.is_finite() {
            format!("{value}")
        } else {
            String::new()
        };
        self.text(name, &text)
    }

    /// Sets a text. Line ends become spaces.
    #[must_use]
    pub fn text(mut self, name: &str, value: &str) -> Self {
        let value = value.replace(['\n', '\r'], " ");
        match self.values.iter_mut().find(|(known, _)| known == name) {
            Some((_, old)) => *old = value,
            None => self.values.push((name.to_owned(), value)),
        }
        self
    }

    /// Returns a number; NaN if it is missing or not a number.
    pub fn value(&self, name: &str) -> f64 {
        self.get(name).parse().unwrap_or(f64::NAN)
    }

    /// Returns a text; empty if it is missing.
    pub fn get(&self, name: &str) -> &str {
        let found = self.values.iter().find(|(known, _)| known == name);
        found.map_or("", |(_, value)| value)
    }

    /// Returns the names of all values.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.values.iter().map(|(name, _)| name.as_str())
    }
}

/// The rows of a study, in the order of its trials.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// All rows.
    pub all: Vec<Row>,
}

impl Rows {
    /// Returns the rows of one trial.
    pub fn of<'a>(&'a self, trial: &'a str) -> impl Iterator<Item = &'a Row> {
        self.with("trial", trial)
    }

    /// Returns the rows in which a column has a given text.
    pub fn with<'a>(&'a self, name: &'a str, word: &'a str) -> impl Iterator<Item = &'a Row> {
        self.all.iter().filter(move |row| row.get(name) == word)
    }
}
