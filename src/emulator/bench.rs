//! A whole device in memory: firmware, optics and a virtual clock, driven step by step. What
//! `phasma serve` does over ports and sockets, this does over function calls.

use super::{Clock, Firmware, FrameSink, Renderer, State, VirtualClock};
use std::sync::Arc;
use std::time::Duration;

/// A device on the bench: no port, no socket, no thread, no waiting.
pub struct Bench<S> {
    firmware: Firmware,
    renderer: Renderer,
    clock: VirtualClock,
    /// Where the frames go.
    pub sink: S,
}

impl<S: FrameSink> Bench<S> {
    /// Puts a device together.
    pub fn new(firmware: Firmware, renderer: Renderer, sink: S) -> Self {
        Self {
            firmware,
            renderer,
            clock: VirtualClock::default(),
            sink,
        }
    }

    /// Sends bytes to the control port, lets time pass until nothing is under way (a free-running
    /// camera gets as far as its commands take no time), and gives what the device sent back.
    pub fn control(&mut self, bytes: &[u8]) -> Vec<u8> {
        let now = self.clock.now_ns(Duration::ZERO);
        self.firmware.set_streaming(self.sink.attended(), now);
        self.firmware.receive(bytes, now);
        self.render();
        while !matches!(self.firmware.state(), State::Free { .. })
            && let Some(next) = self.firmware.next_event_ns()
        {
            self.run_until(next);
        }
        self.firmware.take_output()
    }

    /// Lets time pass until `ns` of device time.
    pub fn run_until(&mut self, ns: u64) {
        self.clock.wait(ns, Duration::ZERO);
        self.firmware.advance(self.clock.now_ns(Duration::ZERO));
        self.render();
    }

    /// The firmware, to look at or to pull its cable.
    pub fn firmware(&mut self) -> &mut Firmware {
        &mut self.firmware
    }

    fn render(&mut self) {
        for exposure in self.firmware.take_exposures() {
            if self.sink.attended() {
                let frame = self.renderer.expose(&exposure.shot);
                self.sink.put(Arc::new(exposure.readout.read(frame)));
            }
            self.firmware.delivered(1);
        }
    }
}
