//! A mapped file that another program cuts short while it is read: the system says so by SIGBUS alone.

/// Ends the process with one line and the exit code of a failed read, instead of a dump of its memory.
/// Outputs have no names until they are whole, so nothing of them is left.
#[cfg(unix)]
pub fn end_with_message() {
    use signal_hook::consts::SIGBUS;
    const LINE: &[u8] = b"error: a file ended while being read: another program truncated it, or its disk failed\n";
    let end = || {
        let _ = rustix::io::write(rustix::stdio::stderr(), LINE);
        signal_hook::low_level::exit(6);
    };
    // SAFETY: the handler does nothing but write a constant and leave, by system calls alone.
    let _ = unsafe { signal_hook::low_level::register(SIGBUS, end) };
}

/// Mapped files cannot be cut short here.
#[cfg(not(unix))]
pub fn end_with_message() {}
