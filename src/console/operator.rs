//! Requests of viewers that a scanner answers.

use phasmid_core::error::Result;
use phasmid_geometry::Board;
use serde::Deserialize;
use serde_json::Value;

/// Items of the device's state that every viewer may request. The ground truth is excluded, because
/// computing it delays the device's frames.
const STATE: [&str; 8] = [
    "calibration",
    "clock",
    "device",
    "faults",
    "fields",
    "objects",
    "plan",
    "sequence",
];

/// A request of a viewer.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// A request for the service channel of an emulated device ([`phasmid_protocol::service`]).
    Service(Value),
    /// A line for the control port.
    Line(String),
    /// Asks for the beginnings of lines that the device may know, for completion.
    Lines {},
    /// Scan once or repeatedly, or stop scanning.
    Scan {
        /// How often.
        run: Run,
        /// Sequence to select; `None` keeps the selected sequence.
        sequence: Option<String>,
    },
    /// A step of a calibration.
    Calibration(Calibration),
    /// Start or end a recording of the scanner.
    Record(bool),
    /// Asks for the names of the recordings that can be opened.
    Recordings {},
    /// Asks for the open recording and the playback position.
    Playback {},
    /// Open a recording.
    Open {
        /// Its name.
        name: String,
    },
    /// Play the open recording, or pause it.
    Play {
        /// Whether playback continues.
        playing: Option<bool>,
        /// Time to jump to, in seconds of the recording.
        at_s: Option<f64>,
        /// Playback speed: seconds of the recording per second.
        speed: Option<f64>,
    },
}

/// How often to scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Run {
    /// Once.
    Once,
    /// Again and again, until another request.
    Repeat,
    /// Stop scanning.
    Stop,
}

/// A step of a calibration.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Calibration {
    /// Look for the board in the latest image.
    Look {},
    /// Asks for the board, the poses so far and the solution.
    State {},
    /// Use another board, and forget the poses.
    Board(Board),
    /// Take the last scan as a pose.
    Take {},
    /// Forget a pose.
    Forget {
        /// Number of the pose; `None` forgets all poses.
        pose: Option<u64>,
    },
    /// Solve for the rig.
    Solve {},
}

impl Request {
    /// Returns whether the request only asks for the device's state.
    pub(crate) fn only_asks(&self) -> bool {
        match self {
            Self::Service(Value::Object(fields)) => {
                let item = fields.get("get").and_then(Value::as_str);
                fields.len() == 1 && item.is_some_and(|item| STATE.contains(&item))
            }
            Self::Calibration(step) => {
                matches!(step, Calibration::Look {} | Calibration::State {})
            }
            Self::Lines {} | Self::Recordings {} | Self::Playback {} => true,
            _ => false,
        }
    }

    /// Returns the kind of this request, as in [`Operator::answers`].
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Service(_) => "service",
            Self::Line(_) | Self::Lines {} => "line",
            Self::Scan { .. } => "scan",
            Self::Calibration(_) => "calibration",
            Self::Record(_) => "record",
            Self::Recordings {} | Self::Playback {} | Self::Open { .. } | Self::Play { .. } => {
                "playback"
            }
        }
    }
}

/// Answers the requests of viewers. Requests that change something come only from the viewer that
/// is in control.
pub trait Operator: Send + Sync {
    /// Returns the kinds of requests that this operator answers: some of `calibration`, `line`,
    /// `playback`, `scan`, `service`.
    fn answers(&self) -> &'static [&'static str];

    /// Answers a request. This may take a long time, during which other requests may arrive.
    ///
    /// # Errors
    /// Returns an error for the viewer.
    fn answer(&self, request: &Request) -> Result<Value>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn requests_that_only_ask_are_known() {
        let of = |value| serde_json::from_value::<Request>(value).unwrap();
        assert!(of(json!({ "service": { "get": "objects" } })).only_asks());
        assert!(of(json!({ "calibration": { "look": {} } })).only_asks());
        for value in [
            json!({ "service": { "do": "trigger" } }),
            json!({ "service": { "get": "clock", "do": "trigger" } }),
            json!({ "service": {} }),
            json!({ "service": { "get": "truth" } }),
            json!({ "service": { "get": ["clock"] } }),
            json!({ "service": ["get"] }),
            json!({ "line": "get" }),
            json!({ "scan": { "run": "stop", "sequence": null } }),
            json!({ "calibration": { "solve": {} } }),
        ] {
            assert!(!of(value.clone()).only_asks(), "{value}");
        }
    }
}
