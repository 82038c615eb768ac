//! Asking for memory ahead of its use.

/// Asks for the cache line at `at`, where the processor has a way to ask.
#[inline(always)]
pub fn fetch<T>(at: &T) {
    #[cfg(target_arch = "x86_64")]
    safe_arch::prefetch_t0(at);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}
