//! Input and output of the passes on a GPU. The types also exist in builds without the feature
//! `gpu`.

use crate::exposure::{Optics, Table};
use crate::scene::Worlds;
use crate::sensor::FixedPattern;
use crate::timetable::Timetable;
use crate::{Options, Plan};
use glam::DVec2;
use phasmid_profile::Profile;
use serde::Serialize;
use std::sync::Arc;

/// Properties of an adapter.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Adapter {
    /// Device name.
    pub name: String,
    /// Discrete, integrated, virtual, or software running on the CPU.
    pub kind: &'static str,
    /// Driver name and version.
    pub driver: String,
    /// Whether the adapter is hardware; `false` for software.
    pub hardware: bool,
}

/// Accumulated time of a pass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PassTime {
    /// Number of runs.
    pub runs: u64,
    /// Total nanoseconds of all runs.
    pub total_ns: f64,
}

/// The renderer's state that the passes read.
pub(crate) struct View<'a> {
    pub(crate) profile: &'a Profile,
    pub(crate) worlds: &'a Worlds,
    pub(crate) optics: &'a Optics,
    /// Ideal image points of the pixels, if the lens has distortion.
    pub(crate) rays: Option<&'a [DVec2]>,
    pub(crate) plan: &'a Plan,
    pub(crate) options: Options,
    pub(crate) fixed: Option<&'a FixedPattern>,
    /// Revision counter of scene and plan.
    pub(crate) revision: u64,
}

/// Light that a shot exposes the pixels to.
pub(crate) struct Shown<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) when: &'a Timetable,
    /// Tables of the visible patterns, numbered as in the timetable.
    pub(crate) tables: &'a [Arc<Table>],
    /// The projector's blur along y over that along x.
    pub(crate) blur_aspect: f64,
    /// Number of pixels of the image.
    pub(crate) pixels: usize,
    /// Whether to add to `electrons`, which already holds other instants of the exposure.
    pub(crate) adds: bool,
}
