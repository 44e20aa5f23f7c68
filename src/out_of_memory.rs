//! Ends the program with a message and status 1 when the system refuses memory, instead of aborting.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{Cursor, Write};

#[global_allocator]
static ALLOCATOR: Reporting = Reporting;

/// The system's allocator, which never returns null.
struct Reporting;

#[allow(unsafe_code, reason = "an allocator is unsafe; this one only forwards")]
// SAFETY: forwards every call with its arguments, and returns what the system's allocator returned.
unsafe impl GlobalAlloc for Reporting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `alloc`.
        granted(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        granted(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `realloc`.
        granted(unsafe { System.realloc(memory, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }
}

fn granted(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() {
        refused(bytes);
    }
    memory
}

/// Reports the refusal without allocating.
#[cold]
fn refused(bytes: usize) -> ! {
    let mut text = [0_u8; 256];
    let mut line = Cursor::new(&mut text[..]);
    let _ = writeln!(
        line,
        "phasmid: out of memory: {bytes} more bytes were refused; expected more free memory, a higher \
         limit (ulimit -v, a container's), or smaller input"
    );
    let len = usize::try_from(line.position()).unwrap_or(0);
    let _ = std::io::stderr().write_all(&text[..len]);
    // This call runs no destructors and allocates no memory.
    std::process::exit(1)
}
