//! A whole device in memory: firmware, optics and a virtual clock, stepped by function calls. Does
//! without ports and sockets what `phasmid serve` does with them.

use super::faults::Faults;
use super::port::Port;
use super::{Firmware, FrameSink, Machine, Renderer, SerialLine, State, VirtualClock};
use std::sync::Arc;

/// A device without port, socket, thread or waiting.
pub struct Bench<S> {
    machine: Machine,
    renderer: Renderer,
    clock: VirtualClock,
    /// Bytes sent to the client and not fetched yet.
    output: Vec<u8>,
    /// Receives the frames.
    pub sink: S,
}

impl<S: FrameSink> Bench<S> {
    /// Assembles a device without faults on a line without delay.
    pub fn new(firmware: Firmware, renderer: Renderer, sink: S) -> Self {
        let machine = Machine::new(
            firmware,
            Port::default(),
            SerialLine::default(),
            Faults::default(),
        );
        Self::of(machine, renderer, sink)
    }

    /// Assembles a device.
    pub fn of(machine: Machine, renderer: Renderer, sink: S) -> Self {
        Self {
            machine,
            renderer,
            clock: VirtualClock::default(),
            output: Vec::new(),
            sink,
        }
    }

    /// Sends bytes to the control port, advances time until no operation is pending and returns the
    /// device's output. A free-running camera advances only as far as its commands take no time.
    pub fn control(&mut self, bytes: &[u8]) -> Vec<u8> {
        let now = self.now_ns();
        let attended = self.sink.attended();
        self.machine.firmware_mut().set_streaming(attended, now);
        self.machine.receive(bytes, now);
        self.render();
        while let Some(next) = self.next_event_ns() {
            self.run_until(next);
        }
        std::mem::take(&mut self.output)
    }

    /// Time of the next event, not counting frames of a free-running camera.
    fn next_event_ns(&self) -> Option<u64> {
        let free = matches!(self.machine.firmware().state(), State::Free { .. });
        self.machine.next_event_ns(free)
    }

    /// Advances to `ns` of device time.
    pub fn run_until(&mut self, ns: u64) {
        self.clock.wait(ns);
        let now = self.now_ns();
        self.machine.advance(now);
        self.render();
    }

    /// Returns the device time in nanoseconds.
    pub fn now_ns(&mut self) -> u64 {
        self.clock.now_ns()
    }

    /// Returns the firmware.
    pub fn firmware(&mut self) -> &mut Firmware {
        self.machine.firmware_mut()
    }

    /// Returns the device without its optics.
    pub fn machine(&mut self) -> &mut Machine {
        &mut self.machine
    }

    fn render(&mut self) {
        let now = self.now_ns();
        for exposure in self.machine.take_exposures(now) {
            let frame = self.sink.attended().then(|| {
                let frame = self.renderer.expose(&exposure.shot);
                Arc::new(exposure.readout.read(frame))
            });
            self.machine.rendered(frame, now);
        }
        while let Some(frame) = self.machine.next_frame(now) {
            self.sink.put(frame);
        }
        self.machine.frames_left();
        let output = self.machine.take_output(now);
        self.output.extend(output);
    }
}
