//! Phasma: a structured-light 3D scanner that is not there.

pub mod calibrate;
pub mod cli;
pub mod decode;
pub mod emulator;
pub mod error;
pub mod geometry;
pub mod host;
pub mod link;
pub mod measure;
pub mod pattern;
pub mod profile;
pub mod protocol;
pub mod study;
