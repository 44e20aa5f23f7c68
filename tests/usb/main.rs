//! The USB device and a USB host of our own, over loopback TCP: no kernel, no privileges.

mod bad_servers;
mod camera;
mod descriptors;
mod detach;
mod negotiation;
mod nonsense;
mod port;
mod requests;
mod served;
