//! A treatment room within the process: a patient, the pods of a station, what they measure and what
//! is true.
//!
//! Frames are those that clients of the served station get (see [`super::scanned`]); the time at which
//! each is exposed is the study's to choose, so that any moment of a treatment is a scan away.

mod patient;
mod pod;
mod pods;
#[cfg(test)]
mod tests;

pub use patient::{InRoom, Moment};
pub use pod::Pod;
pub use pods::{Pods, binned};
