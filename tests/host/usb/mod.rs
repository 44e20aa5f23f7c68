//! The USB device and this project's own USB host, connected over loopback TCP, without a kernel or
//! privileges.

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
