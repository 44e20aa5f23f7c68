//! Requests that a client may send.

use crate::faults::Fault;
use serde::{Deserialize, Serialize};

/// What a client asks for.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Request {
    /// Internal state of the emulator.
    Get(Item),
    /// The truth at a device time in nanoseconds, of a scene that moves; [`Item::Truth`] is that of
    /// the middle of the last sequence.
    #[serde(rename = "truth_at_ns")]
    TruthAt(u64),
    /// Ground truth of a frame, by its id.
    TruthOfFrame(u64),
    /// An external event.
    Do(Action),
    /// Moves an object to another pose in the scene.
    Place(Placement),
    /// Advances stepped time.
    Clock(Step),
    /// Adds a fault.
    Fault(Box<Fault>),
    /// Removes faults.
    ClearFaults(Which),
}

/// Where an object of the scene is to be, as in a scene file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Which object, counted from 0 in the order of the scene file.
    pub object: u32,
    /// Its origin in the scene's frame in millimetres.
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis.
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
}

/// What can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Item {
    /// Ground truth of the frames, over the whole sensor.
    Truth,
    /// Device time and how it passes.
    Clock,
    /// The objects of the scene, and where they are now.
    Objects,
    /// The device's state and counters.
    Device,
    /// Faults in force, and faults that have occurred.
    Faults,
}

impl Item {
    /// All of them, by their names.
    pub(super) const ALL: [(&str, Self); 5] = [
        ("truth", Self::Truth),
        ("clock", Self::Clock),
        ("objects", Self::Objects),
        ("device", Self::Device),
        ("faults", Self::Faults),
    ];
}

/// What can happen to a device from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// A pulse on the external trigger input.
    Trigger,
}

/// How far to advance stepped time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// So many nanoseconds further, up to a day.
    StepNs(u64),
    /// To a device time in nanoseconds, a day from now at most.
    RunUntilNs(u64),
    /// Stop: cancels all pending steps.
    Stop,
}

/// Which faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Which {
    /// The one of this number.
    One(u64),
    /// Every one.
    Every(Every),
}

/// The word for every fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Every {
    /// `all`.
    All,
}

impl Request {
    /// Reads a line.
    ///
    /// # Errors
    /// Returns an error, worded for the reply, if the line is not a valid request.
    pub fn parse(line: &[u8]) -> Result<Self, String> {
        super::parse::request(line)
    }

    /// The line with its newline.
    pub fn to_line(&self) -> String {
        let mut line = serde_json::to_string(self).expect("words and numbers");
        line.push('\n');
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::What;
    use proptest::prelude::*;

    #[test]
    fn requests_have_the_shape_that_is_documented() {
        for (request, line) in [
            (Request::Get(Item::Truth), r#"{"get":"truth"}"#),
            (Request::Get(Item::Clock), r#"{"get":"clock"}"#),
            (Request::Get(Item::Objects), r#"{"get":"objects"}"#),
            (Request::Get(Item::Device), r#"{"get":"device"}"#),
            (Request::Get(Item::Faults), r#"{"get":"faults"}"#),
            (
                Request::Fault(Box::new(Fault {
                    times: Some(2),
                    ..Fault::new(What::Dropped)
                })),
                r#"{"fault":{"what":"dropped","times":2}}"#,
            ),
            (Request::ClearFaults(Which::One(3)), r#"{"clear_faults":3}"#),
            (
                Request::ClearFaults(Which::Every(Every::All)),
                r#"{"clear_faults":"all"}"#,
            ),
            (Request::Do(Action::Trigger), r#"{"do":"trigger"}"#),
            (
                Request::TruthAt(1_500_000_000),
                r#"{"truth_at_ns":1500000000}"#,
            ),
            (Request::TruthOfFrame(12), r#"{"truth_of_frame":12}"#),
            (
                Request::Clock(Step::StepNs(20_000_000)),
                r#"{"clock":{"step_ns":20000000}}"#,
            ),
            (
                Request::Clock(Step::RunUntilNs(7)),
                r#"{"clock":{"run_until_ns":7}}"#,
            ),
            (Request::Clock(Step::Stop), r#"{"clock":"stop"}"#),
            (
                Request::Place(Placement {
                    object: 1,
                    position_mm: [0.1, 0.0, 1000.0],
                    rotation_deg: [0.0, -20.5, 180.0],
                }),
                r#"{"place":{"object":1,"position_mm":[0.1,0.0,1000.0],"rotation_deg":[0.0,-20.5,180.0]}}"#,
            ),
        ] {
            assert_eq!(request.to_line(), format!("{line}\n"));
            assert_eq!(Request::parse(line.as_bytes()), Ok(request));
        }
        for bad in [
            "",
            "{",
            "{\"truth_at_ns\":-1}",
            "{\"truth_at_ns\":1.5}",
            "{\"get\":\"moon\"}",
            "{\"get\":\"truth\",\"x\":1}",
            "{\"clock\":{\"step_ns\":1,\"run_until_ns\":2}}",
            "{\"clock\":{\"step_ns\":-1}}",
            "{\"fault\":{\"what\":\"rain\"}}",
            "{\"clear_faults\":\"some\"}",
            "{\"clear_faults\":-1}",
            "{\"place\":{\"object\":0,\"position_mm\":[0,0,1]}}",
            "{\"place\":{\"object\":-1,\"position_mm\":[0,0,1],\"rotation_deg\":[0,0,0]}}",
            "{\"place\":{\"object\":0,\"position_mm\":[0,0,null],\"rotation_deg\":[0,0,0]}}",
            "{\"place\":{\"object\":0,\"position_mm\":[0,0,1e999],\"rotation_deg\":[0,0,0]}}",
            "[]",
        ] {
            assert!(Request::parse(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            prop_assert!(Request::parse(&bytes).is_err());
        }
    }
}
