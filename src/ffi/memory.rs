//! Out of memory: an error message that says what is saved, instead of an abort.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;
use std::sync::OnceLock;

/// The system's allocator; when it fails, the program ends with an error and exit code 1.
pub struct Allocator;

/// Second part of the error message.
static KEPT: OnceLock<String> = OnceLock::new();

/// Says what is kept when memory runs out. Only the first call counts.
pub fn say_what_is_kept(text: String) {
    // A second render of the same process keeps what it keeps; the message is about the first.
    let _ = KEPT.set(text);
}

unsafe extern "C" {
    /// Ends the process without running what is registered for its exit, which may need memory.
    fn _exit(code: std::ffi::c_int) -> !;
}

#[cold]
fn fail(bytes: usize) -> ! {
    let kept = KEPT.get().map_or("", String::as_str);
    // Formatting into an unbuffered stream allocates nothing. Its failure cannot be reported.
    let _ = writeln!(
        std::io::stderr(),
        "error: out of memory: cannot allocate {bytes} bytes; a smaller --size or --max-memory takes less{kept}"
    );
    // SAFETY: takes no pointer and does not return.
    unsafe { _exit(1) }
}

fn checked(pointer: *mut u8, bytes: usize) -> *mut u8 {
    if pointer.is_null() { fail(bytes) } else { pointer }
}

// SAFETY: everything is passed on to the system's allocator, whose contract is the same.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        checked(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        checked(unsafe { System.realloc(pointer, layout, size) }, size)
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}
