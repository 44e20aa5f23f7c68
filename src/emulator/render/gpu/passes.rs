//! The state of a rendering on a GPU: what its maps hold, and frames on their way back.

use super::frames::{Frames, Ticket};
use super::{Engine, Gpu, PassTime};
use crate::error::Result;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The passes of one renderer.
pub(in crate::emulator::render) struct Passes {
    pub(in crate::emulator::render) engine: Engine,
    frames: Frames,
    /// The revision of scene and plan that the maps hold.
    pub(in crate::emulator::render) holds: Option<u64>,
}

impl Passes {
    pub(in crate::emulator::render) fn new(gpu: Arc<Gpu>) -> Self {
        Self {
            engine: Engine::new(gpu),
            frames: Frames::default(),
            holds: None,
        }
    }

    /// Submits the passes of a frame of so many bytes.
    ///
    /// # Errors
    /// A GPU that has failed.
    pub(in crate::emulator::render) fn submit(
        &mut self,
        commands: super::Commands,
        bytes: usize,
    ) -> Result<Ticket> {
        self.frames.submit(&self.engine, commands, bytes)
    }

    /// Waits for a frame.
    ///
    /// # Errors
    /// A GPU that has failed.
    pub(in crate::emulator::render) fn take(&mut self, ticket: Ticket) -> Result<Vec<u8>> {
        let gpu = self.engine.gpu().clone();
        self.frames.take(&gpu, ticket)
    }

    /// What passes have taken since they are timed, by shader and entry point.
    pub(in crate::emulator::render) fn times(&mut self) -> BTreeMap<String, PassTime> {
        self.engine.times()
    }
}
