//! Requests that a client may send.

use super::about::ClockPace;
use crate::faults::Fault;
use serde::{Deserialize, Serialize};

/// A client's request.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Request {
    /// Internal state of the emulator.
    Get(Item),
    /// Objects of the scene at a device time in nanoseconds. Animated and breathing objects have
    /// their poses of that time, all others the poses in which they were last placed.
    #[serde(rename = "objects_at_ns")]
    ObjectsAt(u64),
    /// Ground truth of a moving scene at a device time in nanoseconds. [`Item::Truth`] is the
    /// ground truth at the middle of the last sequence.
    #[serde(rename = "truth_at_ns")]
    TruthAt(u64),
    /// Ground truth of a frame, by frame id.
    TruthOfFrame(u64),
    /// Simulates an external event.
    Do(Action),
    /// Moves an object to another pose in the scene.
    Place(Placement),
    /// Sets a field of the scene, as `--set` does: `object[0].albedo=0.4`.
    Set(String),
    /// Includes or excludes a term of image formation.
    Term(TermChoice),
    /// Advances stepped time.
    Clock(Step),
    /// Adds a fault.
    Fault(Box<Fault>),
    /// Removes faults.
    ClearFaults(Which),
}

/// New pose of an object, as in a scene file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Index of the object, from 0, in the order of the scene file.
    pub object: u32,
    /// Origin of the object in the scene's frame in millimetres.
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis.
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
}

/// Whether a term of image formation is computed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TermChoice {
    /// Name of the term, as in the plan.
    pub term: String,
    /// Whether it is computed.
    pub included: bool,
}

/// Kinds of state that a client can request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Item {
    /// Ground truth of the frames, over the whole sensor.
    Truth,
    /// Device time and clock mode.
    Clock,
    /// Objects of the scene and their current poses.
    Objects,
    /// The device's state and counters.
    Device,
    /// Active faults and past fault occurrences.
    Faults,
    /// The selected sequence.
    Sequence,
    /// The calibration that the device reports.
    Calibration,
    /// The fields of the scene.
    Fields,
    /// The terms of image formation that are computed.
    Plan,
}

impl Item {
    /// All items with their names.
    pub(super) const ALL: [(&str, Self); 9] = [
        ("truth", Self::Truth),
        ("clock", Self::Clock),
        ("objects", Self::Objects),
        ("device", Self::Device),
        ("faults", Self::Faults),
        ("sequence", Self::Sequence),
        ("calibration", Self::Calibration),
        ("fields", Self::Fields),
        ("plan", Self::Plan),
    ];
}

/// External events that act on a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// A pulse on the external trigger input.
    Trigger,
}

/// Advance of stepped time, or a change of the pace.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// By this many nanoseconds, at most a day.
    StepNs(u64),
    /// To this device time in nanoseconds, at most a day ahead.
    RunUntilNs(u64),
    /// Cancels all pending steps.
    Stop,
    /// Changes the clock's pace.
    Pace(ClockPace),
}

/// Faults to remove.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Which {
    /// The fault with this id.
    One(u64),
    /// All faults.
    Every(Every),
}

/// Keyword for all faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Every {
    /// `all`.
    All,
}

impl Request {
    /// Serializes the request, including its newline.
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
            (Request::Get(Item::Sequence), r#"{"get":"sequence"}"#),
            (Request::Get(Item::Calibration), r#"{"get":"calibration"}"#),
            (Request::Get(Item::Fields), r#"{"get":"fields"}"#),
            (Request::Get(Item::Plan), r#"{"get":"plan"}"#),
            (
                Request::Set("object[0].albedo=0.4".into()),
                r#"{"set":"object[0].albedo=0.4"}"#,
            ),
            (
                Request::Term(TermChoice {
                    term: "noise".into(),
                    included: false,
                }),
                r#"{"term":{"term":"noise","included":false}}"#,
            ),
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
            (Request::ObjectsAt(7), r#"{"objects_at_ns":7}"#),
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
                Request::Clock(Step::Pace(ClockPace::Fast)),
                r#"{"clock":{"pace":"fast"}}"#,
            ),
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
            "{\"set\":1}",
            "{\"term\":\"noise\"}",
            "{\"term\":{\"term\":\"noise\"}}",
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
