//! Handles SIGBUS, which the system sends if another program truncates a memory-mapped file.

/// Ends the process with one line and the exit code of a failed read. Outputs have no names until they are complete, so
/// nothing remains.
#[cfg(unix)]
pub fn end_with_message() {
    use signal_hook::consts::SIGBUS;
    const LINE: &[u8] = b"error: a file ended while being read: another program truncated it, or its disk failed\n";
    let end = || {
        let _ = rustix::io::write(rustix::stdio::stderr(), LINE);
        signal_hook::low_level::exit(6);
    };
    // SAFETY: the handler only writes a constant and exits, both by system calls.
    let _ = unsafe { signal_hook::low_level::register(SIGBUS, end) };
}

/// Mapped files cannot be truncated on this system.
#[cfg(not(unix))]
pub fn end_with_message() {}
