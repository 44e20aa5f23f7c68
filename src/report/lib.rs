//! Plots, images of maps, and the framework of the studies.
//!
//! | module | contents |
//! | --- | --- |
//! | `plot` | plots as SVG |
//! | `map_image` | maps as images with a colour scale, and shaded relief |
//! | `colour`, `font` | colour scales and a bitmap font for these images |
//! | `lab` | the framework of the studies |
//! | `stopwatch`, `spread` | measured times and their quartiles |

mod colour;
pub mod font;
pub mod lab;
pub mod map_image;
pub mod plot;
pub mod spread;
pub mod stopwatch;
