//! The same kernel compiled twice: for any machine, and for the widest vectors of this one.
#![allow(unsafe_code)] // Calling a function compiled for AVX2 is safe only where the machine has it; this is the one place.

/// Run `work`, compiled for AVX2 where the machine has it.
///
/// `work` should only call a function that is `#[inline(always)]`, so that its body is compiled for
/// both. Fused multiplications are not used: both give the same answer bit for bit.
#[inline]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn with_avx2<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine was just seen to have AVX2.
            return unsafe { with_avx2(work) };
        }
    }
    work()
}
