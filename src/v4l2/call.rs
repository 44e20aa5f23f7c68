//! One ioctl with a typed argument.

use std::io;
use std::os::raw::c_void;
use v4l::device::Handle;
use v4l::v4l2::{self, vidioc};

/// Calls the driver, and repeats the call if a signal interrupts it.
///
/// # Safety
/// The argument of `request` must be of type `T`, and all pointers in `T` must be valid for it.
#[allow(unsafe_code)]
pub(super) unsafe fn ioctl<T>(
    handle: &Handle,
    request: vidioc::_IOC_TYPE,
    argument: &mut T,
) -> io::Result<()> {
    loop {
        // SAFETY: the handle's descriptor is open, and the caller guarantees the argument.
        let done = unsafe {
            v4l2::ioctl(
                handle.fd(),
                request,
                std::ptr::from_mut(argument).cast::<c_void>(),
            )
        };
        match done {
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}
