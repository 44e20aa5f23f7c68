//! The firmware in virtual time, as a client of the control port sees it.

mod commands;
mod documentation;
mod rolling;
mod sequences;
mod streams;
mod tickets;
mod timing;
mod triggers;

use super::Firmware;
use crate::Exposure;
use phasmid_profile::Profile;

const MS: u64 = 1_000_000;

/// A device whose clock the test sets by hand; frames leave it at once.
struct Port {
    firmware: Firmware,
    now_ns: u64,
    shots: Vec<Exposure>,
}

impl Port {
    fn new() -> Self {
        Self::of(&Profile::load("webcam-grey").unwrap())
    }

    fn of(profile: &Profile) -> Self {
        Self {
            firmware: Firmware::new(profile, &[]).unwrap(),
            now_ns: 0,
            shots: Vec::new(),
        }
    }

    fn bytes(&mut self, bytes: &[u8]) -> String {
        self.firmware.receive(bytes, self.now_ns);
        self.collect();
        String::from_utf8(self.firmware.take_output()).unwrap()
    }

    fn ask(&mut self, line: &str) -> String {
        let reply = self.bytes(format!("{line}\n").as_bytes());
        reply.trim_end().to_owned()
    }

    /// Sends a line and checks that it causes neither an answer nor an error.
    fn tell(&mut self, line: &str) {
        assert_eq!(self.ask(line), "", "{line}");
        assert_eq!(self.error(), 0, "{line}");
    }

    fn error(&mut self) -> i32 {
        let reply = self.ask("SYST:ERR?");
        reply.split_once(',').unwrap().0.parse().unwrap()
    }

    fn at(&mut self, ns: u64) -> String {
        self.now_ns = ns;
        self.firmware.advance(ns);
        self.collect();
        String::from_utf8(self.firmware.take_output()).unwrap()
    }

    fn collect(&mut self) {
        let new = self.firmware.take_exposures();
        self.firmware.delivered(new.len() as u64);
        self.shots.extend(new);
    }

    /// Returns id, pattern and start of each shot since the last call.
    fn taken(&mut self) -> Vec<(u64, Option<u32>, u64)> {
        self.shots
            .drain(..)
            .map(|e| (e.shot.id, e.shot.pattern_index, e.shot.start_ns))
            .collect()
    }
}
