//! Inputs and outputs of the GPU passes. These types also exist in builds without the feature `gpu`.

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
    /// Kind of adapter: discrete, integrated, virtual, or software that runs on the CPU.
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

/// The parts of the renderer's state that the passes read.
pub(crate) struct View<'a> {
    pub(crate) profile: &'a Profile,
    pub(crate) worlds: &'a Worlds,
    pub(crate) optics: &'a Optics,
    /// Ideal image points of the pixels, if the lens has distortion.
    pub(crate) rays: Option<&'a [DVec2]>,
    pub(crate) plan: &'a Plan,
    pub(crate) options: Options,
    pub(crate) fixed: Option<&'a FixedPattern>,
    /// Revision of scene and plan; it changes whenever one of them does.
    pub(crate) revision: u64,
}

/// The light to which a shot exposes the pixels.
pub(crate) struct Shown<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) when: &'a Timetable,
    /// Tables of the visible patterns, numbered as in the timetable.
    pub(crate) tables: &'a [Arc<Table>],
    /// Ratio of the projector's blur along y to its blur along x.
    pub(crate) blur_aspect: f64,
    /// Number of pixels of the image.
    pub(crate) pixels: usize,
    /// Whether to add to `electrons`, which already holds the light of other instants of the
    /// exposure.
    pub(crate) adds: bool,
}
