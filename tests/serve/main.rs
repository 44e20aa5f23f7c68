//! `phasma serve` and `phasma scan` as processes: ports, sockets, signals, and clients that
//! misbehave.

mod clients;
mod directory;
mod place;
mod scan;
mod served;
mod several;
mod stream;
mod usb;
