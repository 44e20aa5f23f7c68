//! The system's monotonic clock, by which V4L2 times frames.

/// Nanoseconds of the system's monotonic clock, by which V4L2 times frames; 0 where there is none.
#[cfg(unix)]
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
    seconds * 1_000_000_000 + u64::try_from(now.tv_nsec).unwrap_or(0)
}

/// Nothing times frames by it here.
#[cfg(not(unix))]
pub fn monotonic_ns() -> u64 {
    0
}
