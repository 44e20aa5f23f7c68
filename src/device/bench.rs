//! A whole device in memory: firmware, optics and a virtual clock, stepped by function calls. It
//! behaves like `phasmid serve`, but has no ports or sockets. Device time is in integer nanoseconds
//! since power-on. The device never reads a wall clock: a bench passes it the time of a virtual
//! clock, a server the time of its timeline.

use super::{Device, Firmware, FrameSink, Machine, State};
use std::sync::Arc;

/// A clock that stands still until something waits for a point in time; the clock then jumps to that
/// point. A sequence therefore takes no longer than its rendering, and every run is identical to the
/// nanosecond.
#[derive(Debug, Clone, Copy, Default)]
pub struct VirtualClock {
    now_ns: u64,
}

impl VirtualClock {
    /// Returns the device time in nanoseconds; it never decreases.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Jumps to `until_ns` if that is in the future.
    pub fn wait(&mut self, until_ns: u64) {
        self.now_ns = self.now_ns.max(until_ns);
    }
}

impl Device {
    /// Puts the device on a virtual clock, where function calls advance time; `sink` receives its
    /// frames.
    pub fn bench<S: FrameSink>(self, sink: S) -> Bench<S> {
        Bench::new(self, sink)
    }
}

/// A device in memory, without port, socket or thread, whose virtual time needs no waiting.
pub struct Bench<S> {
    device: Device,
    clock: VirtualClock,
    /// Bytes that the device has sent to the client and that [`Self::take_output`] has not returned
    /// yet.
    output: Vec<u8>,
    /// Receives the frames.
    pub sink: S,
}

impl<S: FrameSink> Bench<S> {
    /// Puts a device on a virtual clock.
    pub fn new(device: Device, sink: S) -> Self {
        Self {
            device,
            clock: VirtualClock::default(),
            output: Vec::new(),
            sink,
        }
    }

    /// Takes the device off the bench.
    pub fn into_device(self) -> Device {
        self.device
    }

    /// Sends bytes to the control port, advances time until no operation is pending and returns the
    /// device's output. Frames of a free-running camera are not pending operations.
    pub fn control(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.receive(bytes);
        while let Some(next) = self.next_event_ns() {
            self.run_until(next);
        }
        self.take_output()
    }

    /// Sends bytes to the control port at the present device time.
    pub fn receive(&mut self, bytes: &[u8]) {
        let now = self.now_ns();
        self.stream();
        self.device.machine.receive(bytes, now);
        self.render();
    }

    /// Takes the bytes that the device has sent to the client since the last call.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    /// Returns the time of the next event, not counting frames of a free-running camera.
    fn next_event_ns(&self) -> Option<u64> {
        let free = matches!(self.device.machine.firmware().state(), State::Free { .. });
        self.device.machine.next_event_ns(free)
    }

    /// Advances to `ns` of device time.
    pub fn run_until(&mut self, ns: u64) {
        self.clock.wait(ns);
        let now = self.now_ns();
        self.stream();
        self.device.machine.advance(now);
        self.render();
    }

    /// Returns the device time in nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    /// Returns the firmware.
    pub fn firmware(&mut self) -> &mut Firmware {
        self.device.machine.firmware_mut()
    }

    /// Returns the device without its optics.
    pub fn machine(&self) -> &Machine {
        &self.device.machine
    }

    /// Returns the device for modification.
    pub fn device_mut(&mut self) -> &mut Device {
        &mut self.device
    }

    /// Tells the firmware whether a client reads frames.
    fn stream(&mut self) {
        let (now, attended) = (self.now_ns(), self.sink.attended());
        self.device
            .machine
            .firmware_mut()
            .set_streaming(attended, now);
    }

    fn render(&mut self) {
        let now = self.now_ns();
        for exposure in self.device.machine.take_exposures(now) {
            let frame = self.sink.attended().then(|| {
                let frame = self.device.renderer.expose(&exposure.shot);
                Arc::new(exposure.readout.read(frame))
            });
            self.device.machine.rendered(frame, now);
        }
        while let Some(frame) = self.device.machine.next_frame(now) {
            self.sink.put(frame);
        }
        self.device.machine.frames_left();
        let output = self.device.machine.take_output(now);
        self.output.extend(output);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waiting_advances_the_clock_and_never_sets_it_back() {
        let mut clock = VirtualClock::default();
        assert_eq!(clock.now_ns(), 0);
        clock.wait(7_000_000);
        clock.wait(1);
        assert_eq!(clock.now_ns(), 7_000_000);
    }
}
