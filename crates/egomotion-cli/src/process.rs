//! What the whole process shares: its memory and its worker threads.

use anyhow::{Context, Result};

/// Let freed memory be used again instead of going back to the system.
///
/// A dense frame allocates some 60 MB of maps and frees as much. The C library hands blocks of that size
/// back at once, and the next frame pays a page fault for every 4 kB: a sixth of its time.
pub fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const LARGEST_KEPT_BYTES: libc::c_int = 1 << 30;
        #[allow(unsafe_code, reason = "the allocator's settings have no safe interface")]
        // SAFETY: both settings are plain numbers, and no other thread runs yet.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGEST_KEPT_BYTES);
            libc::mallopt(libc::M_TRIM_THRESHOLD, LARGEST_KEPT_BYTES);
        }
    }
}

/// Use this many worker threads in the whole process; all cores if `None`.
pub fn set_threads(threads: Option<usize>) -> Result<()> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .context("cannot start the threads")?;
    }
    Ok(())
}
