//! Input of the geometry pass.

use super::aperture::Aperture;
use super::rays::Rays;
use crate::exposure::Optics;
use crate::scene::Worlds;
use crate::{Options, Plan};

/// Scene, camera and settings of a geometry pass.
#[derive(Clone, Copy)]
pub(crate) struct Input<'a> {
    pub(crate) worlds: &'a Worlds,
    pub(crate) optics: &'a Optics,
    pub(crate) rays: &'a Rays<'a>,
    pub(crate) plan: &'a Plan,
    pub(crate) options: Options,
    pub(crate) aperture: Aperture,
}
