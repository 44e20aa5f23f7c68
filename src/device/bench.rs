//! A whole device in memory: firmware, optics and a virtual clock, driven step by step. What
//! `phasmid serve` does over ports and sockets, this does over function calls.

use super::faults::Faults;
use super::port::Port;
use super::{Firmware, FrameSink, Machine, Renderer, SerialLine, State, VirtualClock};
use std::sync::Arc;

/// A device on the bench: no port, no socket, no thread, no waiting.
pub struct Bench<S> {
    machine: Machine,
    renderer: Renderer,
    clock: VirtualClock,
    /// What has reached the client and was not asked for yet.
    output: Vec<u8>,
    /// Where the frames go.
    pub sink: S,
}

impl<S: FrameSink> Bench<S> {
    /// Puts a device together that works as it should, on a line that takes no time.
    pub fn new(firmware: Firmware, renderer: Renderer, sink: S) -> Self {
        let machine = Machine::new(
            firmware,
            Port::default(),
            SerialLine::default(),
            Faults::default(),
        );
        Self::of(machine, renderer, sink)
    }

    /// Puts a device together.
    pub fn of(machine: Machine, renderer: Renderer, sink: S) -> Self {
        Self {
            machine,
            renderer,
            clock: VirtualClock::default(),
            output: Vec::new(),
            sink,
        }
    }

    /// Sends bytes to the control port, lets time pass until nothing is under way (a free-running
    /// camera gets as far as its commands take no time), and gives what the device sent back.
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

    /// When something happens next; the frames of a free-running camera are nothing.
    fn next_event_ns(&self) -> Option<u64> {
        let free = matches!(self.machine.firmware().state(), State::Free { .. });
        self.machine.next_event_ns(free)
    }

    /// Lets time pass until `ns` of device time.
    pub fn run_until(&mut self, ns: u64) {
        self.clock.wait(ns);
        let now = self.now_ns();
        self.machine.advance(now);
        self.render();
    }

    /// Device time.
    pub fn now_ns(&mut self) -> u64 {
        self.clock.now_ns()
    }

    /// The firmware, to look at.
    pub fn firmware(&mut self) -> &mut Firmware {
        self.machine.firmware_mut()
    }

    /// The device without its optics.
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
