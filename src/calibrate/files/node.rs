//! Data structures common to all foreign formats: named numbers and matrices, each with its
//! line number in the file.

use super::number::number;
use phasmid_geometry::file;

/// An error with the line of the file that it concerns (0 if it concerns no particular line).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    pub line: usize,
    pub found: String,
    pub allowed: String,
}

impl Fault {
    pub(super) fn new(
        line: usize,
        found: impl std::fmt::Display,
        allowed: impl std::fmt::Display,
    ) -> Self {
        Self {
            line,
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }
}

/// Value of a node.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    /// One number or a list of numbers.
    List(Vec<f64>),
    /// A matrix in row-major order. Each channel of an element counts as a column.
    Matrix {
        rows: usize,
        cols: usize,
        data: Vec<f64>,
    },
}

impl Value {
    /// The numbers in row-major order.
    pub(super) fn numbers(&self) -> &[f64] {
        match self {
            Self::List(data) | Self::Matrix { data, .. } => data,
        }
    }
}

/// A named node.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub name: &'static str,
    pub line: usize,
    pub value: Value,
}

/// The nodes of a file that are relevant for a calibration. Other nodes are ignored, whatever they
/// contain.
#[derive(Debug, Default)]
pub(super) struct Nodes(Vec<Node>);

impl Nodes {
    /// Stores a node if its name is one of [`names::ALL`].
    ///
    /// # Errors
    /// Returns an error if the name occurs twice or `value` fails.
    pub(super) fn add(
        &mut self,
        name: &str,
        line: usize,
        value: impl FnOnce() -> Result<Value, Fault>,
    ) -> Result<(), Fault> {
        let Some(name) = names::ALL.iter().copied().flatten().find(|n| **n == name) else {
            return Ok(());
        };
        if let Some(first) = self.0.iter().find(|node| node.name == *name) {
            let found = format!("{name} again, after line {}", first.line);
            return Err(Fault::new(line, found, "each name once"));
        }
        let value = value().map_err(|fault| Fault {
            found: format!("{name}: {}", fault.found),
            ..fault
        })?;
        self.0.push(Node { name, line, value });
        Ok(())
    }

    /// Returns the node that has one of these synonymous names; `None` if no node has one.
    ///
    /// # Errors
    /// Returns an error if two of them have different values.
    pub(super) fn get(&self, names: &[&str]) -> Result<Option<&Node>, Fault> {
        let mut found = self.0.iter().filter(|node| names.contains(&node.name));
        let Some(first) = found.next() else {
            return Ok(None);
        };
        match found.find(|other| other.value.numbers() != first.value.numbers()) {
            None => Ok(Some(first)),
            Some(other) => Err(Fault::new(
                other.line,
                format!(
                    "{} that differs from {} of line {}",
                    other.name, first.name, first.line
                ),
                "the same numbers, or one of the two",
            )),
        }
    }
}

/// Names of nodes in files written by Phasmid, by SLStudio, and by other tools based on OpenCV.
pub(super) mod names {
    pub const CAMERA: &[&str] = &["camera_matrix", "Kc", "cam_K", "M1"];
    pub const CAMERA_LENS: &[&str] = &["distortion_coefficients", "kc", "cam_kc", "D1"];
    pub const PROJECTOR: &[&str] = &["projector_matrix", "Kp", "proj_K", "M2"];
    pub const PROJECTOR_LENS: &[&str] =
        &["projector_distortion_coefficients", "kp", "proj_kc", "D2"];
    pub const ROTATION: &[&str] = &["R", "Rp"];
    pub const TRANSLATION: &[&str] = &["T", "Tp"];
    pub const CAMERA_WIDTH: &[&str] = &["image_width", "frameWidth", "frame_width"];
    pub const CAMERA_HEIGHT: &[&str] = &["image_height", "frameHeight", "frame_height"];
    pub const PROJECTOR_WIDTH: &[&str] = &["projector_width", "screenResX", "screen_res_x"];
    pub const PROJECTOR_HEIGHT: &[&str] = &["projector_height", "screenResY", "screen_res_y"];
    /// All names.
    pub const ALL: &[&[&str]] = &[
        CAMERA,
        CAMERA_LENS,
        PROJECTOR,
        PROJECTOR_LENS,
        ROTATION,
        TRANSLATION,
        CAMERA_WIDTH,
        CAMERA_HEIGHT,
        PROJECTOR_WIDTH,
        PROJECTOR_HEIGHT,
    ];
}

/// The line on which a piece of text begins, and the text.
pub(super) type Piece<'a> = (usize, &'a str);

/// Parses numbers separated by white space and commas.
pub(super) fn numbers(pieces: &[Piece<'_>]) -> Result<Vec<f64>, Fault> {
    let mut found = Vec::new();
    for &(first, text) in pieces {
        for (at, line) in text.lines().enumerate() {
            let words = line.split(|c: char| c == ',' || c.is_whitespace());
            for word in words.filter(|word| !word.is_empty()) {
                let value =
                    number(word).ok_or_else(|| Fault::new(first + at, quoted(word), "a number"))?;
                found.push(value);
            }
        }
    }
    Ok(found)
}

/// The fields of an `opencv-matrix`, with their lines.
#[derive(Debug, Default)]
pub(super) struct Fields<'a> {
    pub rows: Option<Piece<'a>>,
    pub cols: Option<Piece<'a>>,
    pub dt: Option<Piece<'a>>,
    pub data: Option<Vec<Piece<'a>>>,
}

impl Fields<'_> {
    /// Builds the matrix of a node on `line`.
    pub(super) fn matrix(&self, line: usize) -> Result<Value, Fault> {
        let count = |field: Option<Piece<'_>>, name| {
            let (line, text) = field
                .ok_or_else(|| Fault::new(line, format!("no {name}"), "rows, cols, dt, data"))?;
            text.trim()
                .parse::<u32>()
                .ok()
                .map(|n| n as usize)
                .ok_or_else(|| {
                    let found = format!("{name}: {}", quoted(text.trim()));
                    Fault::new(line, found, "a whole number")
                })
        };
        let (rows, cols) = (count(self.rows, "rows")?, count(self.cols, "cols")?);
        let channels = match self.dt {
            None => 1,
            Some((line, text)) => channels(text).ok_or_else(|| {
                let found = format!("dt: {}", quoted(text.trim()));
                Fault::new(line, found, "a type such as d or f")
            })?,
        };
        let pieces = self
            .data
            .as_ref()
            .ok_or_else(|| Fault::new(line, "no data", "rows, cols, dt, data"))?;
        let data = numbers(pieces)?;
        let cols = cols.saturating_mul(channels);
        if rows.saturating_mul(cols) != data.len() {
            return Err(Fault::new(
                line,
                format!("{} numbers", data.len()),
                format!("{rows} x {cols}, as rows, cols and dt say"),
            ));
        }
        Ok(Value::Matrix { rows, cols, data })
    }
}

/// Parses the number of channels from OpenCV's element type, which is a channel count (1 if absent)
/// and a letter.
fn channels(dt: &str) -> Option<usize> {
    let dt = dt.trim().trim_matches('"');
    let digits = dt.trim_end_matches(|c: char| "ucwsifdhIUL".contains(c));
    (dt.len() == digits.len() + 1)
        .then(|| match digits {
            "" => Some(1),
            _ => digits.parse().ok().filter(|n| (1..=512).contains(n)),
        })
        .flatten()
}

/// The beginning of a word, made printable for a message.
pub(super) fn quoted(word: &str) -> String {
    file::quoted(word.as_bytes())
}
