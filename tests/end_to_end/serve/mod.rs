//! `phasmid serve` and `phasmid scan` as processes: ports, sockets, signals, and clients that
//! misbehave.

mod clients;
mod clock;
mod dialects;
mod directory;
mod place;
mod pods;
mod scan;
mod service;
mod several;
mod station;
mod stream;
mod tcp;
mod usb;
