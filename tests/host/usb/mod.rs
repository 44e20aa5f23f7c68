//! The USB device and a USB host of our own, over loopback TCP: no kernel, no privileges.

mod bad_servers;
mod camera;
mod descriptors;
mod detach;
#[path = "../../fuzz/src/usb/mod.rs"]
mod fuzz;
mod hostile;
mod info;
mod negotiation;
mod nonsense;
mod packed;
mod port;
mod replies;
mod requests;
mod served;
