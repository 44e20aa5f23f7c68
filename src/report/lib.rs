//! Plots and pictures.

mod colour;
pub mod font;
pub mod lab;
pub mod picture;
pub mod plot;
pub mod spread;
pub mod stopwatch;
