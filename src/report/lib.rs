//! Plots, images of maps, and the framework of the studies.
//!
//! | module | contents |
//! | --- | --- |
//! | `plot` | plots as SVG |
//! | `map_image` | maps as images with title, colour bar and legend |
//! | `colour`, `font`, `relief` | colour scales, text and shading of these images |
//! | `lab` | the framework of the studies |
//! | `stopwatch`, `spread` | measured times and their quartiles |

mod colour;
pub mod font;
pub mod lab;
pub mod map_image;
pub mod plot;
pub mod relief;
pub mod spread;
pub mod stopwatch;
