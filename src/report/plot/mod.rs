//! Plots as SVG: axes, bars, curves, arrows and cells on a sheet, without scripts or embedded fonts,
//! readable on light and dark backgrounds.
//!
//! A [`Sheet`] collects the drawing and becomes an `<svg>` element. An [`Axis`] maps values to the unit
//! interval, with ticks at round numbers. A [`Panel`] is an area of the sheet with two axes. Values that
//! are not finite are omitted, so a file never contains "NaN". [`STYLE`] defines the look of the
//! classes: include it once in a page, or use [`Sheet::into_file`], which contains it.

// Why not `plotters` 0.3.7: a port of axes, marks, panels and sheets has as many lines (507 to 521).
// Its ticks and labels fail on small and short logarithmic ranges, its ranges hang on infinite ends,
// its coordinates are whole pixels, and it writes neither classes for light and dark backgrounds nor
// tooltips of single marks.

mod axis;
mod bars;
mod histogram;
mod marks;
mod panel;
mod quiver;
mod sheet;
mod text;
mod ticks;

pub use axis::{Axis, Scale};
pub use bars::{bars, room_for_names};
pub use histogram::Histogram;
pub use marks::{cells, curve, dots, spans};
pub use panel::{Panel, ROOM};
pub use quiver::{Arrow, quiver};
pub use sheet::{Anchor, PAGE_STYLE, STYLE, Sheet};
pub use text::{escaped, figures};
pub(crate) use ticks::linear as linear_ticks;
