//! Rows: what a trial found, by the names of columns.

/// Values by name. They are kept as they are written down, so that a row that was read from a file
/// is the row that was written: a number has as many digits as bring the same number back.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Row {
    values: Vec<(String, String)>,
}

impl Row {
    /// The columns that the rows of all studies begin with: the trial, which of its rows this is and
    /// of how many, its seed, what computed it (`cpu`, `gpu`, the adapter's name), the source's
    /// revision, the threads, and the seconds that the trial took.
    pub const COMMON: [&str; 9] = [
        "trial", "part", "parts", "seed", "backend", "adapter", "revision", "threads", "seconds",
    ];

    /// A row without values.
    pub fn new() -> Self {
        Self::default()
    }

    /// With a number more; one that is not finite is left empty.
    #[must_use]
    pub fn number(self, name: &str, value: f64) -> Self {
        let text = if value.is_finite() {
            format!("{value}")
        } else {
            String::new()
        };
        self.text(name, &text)
    }

    /// With a word more. Line ends become spaces.
    #[must_use]
    pub fn text(mut self, name: &str, value: &str) -> Self {
        let value = value.replace(['\n', '\r'], " ");
        match self.values.iter_mut().find(|(known, _)| known == name) {
            Some((_, old)) => *old = value,
            None => self.values.push((name.to_owned(), value)),
        }
        self
    }

    /// A number; NaN where there is none.
    pub fn value(&self, name: &str) -> f64 {
        self.get(name).parse().unwrap_or(f64::NAN)
    }

    /// A word; empty where there is none.
    pub fn get(&self, name: &str) -> &str {
        let found = self.values.iter().find(|(known, _)| known == name);
        found.map_or("", |(_, value)| value)
    }

    /// The names of its values.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.values.iter().map(|(name, _)| name.as_str())
    }
}

/// The rows of a study, in the order of its trials.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// All of them.
    pub all: Vec<Row>,
}

impl Rows {
    /// Those of one trial.
    pub fn of<'a>(&'a self, trial: &'a str) -> impl Iterator<Item = &'a Row> {
        self.with("trial", trial)
    }

    /// Those in which a column has a certain word.
    pub fn with<'a>(&'a self, name: &'a str, word: &'a str) -> impl Iterator<Item = &'a Row> {
        self.all.iter().filter(move |row| row.get(name) == word)
    }
}
