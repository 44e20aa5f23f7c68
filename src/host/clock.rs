//! The system's monotonic clock, which V4L2 uses for frame timestamps.

/// Returns the system's monotonic time in nanoseconds, the clock of V4L2 timestamps; 0 on systems
/// without it.
#[cfg(unix)]
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
    seconds * 1_000_000_000 + u64::try_from(now.tv_nsec).unwrap_or(0)
}

/// Always returns 0: on this system no frames are timestamped by this clock.
#[cfg(not(unix))]
pub fn monotonic_ns() -> u64 {
    0
}
