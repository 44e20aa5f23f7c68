//! Plots as SVG: small parts (axes, bars, curves, arrows, cells) on a sheet, without scripts or fonts
//! of their own, readable on light and dark ground.
//!
//! A [`Sheet`] is drawn on, and ends as an `<svg>` element; an [`Axis`] carries values to the unit
//! interval, with ticks at round numbers; a [`Panel`] is two axes at a place of the sheet. Values
//! that are not finite are left out, never drawn somewhere: a file holds no "NaN". [`STYLE`] says
//! what the classes look like; put it once into a page, or take [`Sheet::into_file`], which has it.

mod axis;
mod bars;
mod cells;
mod histogram;
mod marks;
mod panel;
mod quiver;
mod sheet;
mod style;
mod text;
mod ticks;

pub use axis::{Axis, Scale};
pub use bars::{bars, room_for_names};
pub use cells::cells;
pub use histogram::Histogram;
pub use marks::{curve, dots, spans};
pub use panel::{Panel, ROOM};
pub use quiver::{Arrow, quiver};
pub use sheet::{Anchor, Sheet};
pub use style::{PAGE_STYLE, STYLE};
pub use text::{escaped, figures};
