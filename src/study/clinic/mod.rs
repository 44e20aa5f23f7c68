//! A treatment room in this process: a patient, the pods of a station, their measurements and the
//! truth.
//!
//! Frames are those that clients of the served station receive (see [`super::scanned`]). The study
//! chooses the time of each exposure, so any moment of a treatment can be scanned directly.

mod patient;
mod pod;
mod pods;
#[cfg(test)]
mod tests;

pub use patient::{InRoom, Moment};
pub use pod::Pod;
pub use pods::{Pods, binned};
