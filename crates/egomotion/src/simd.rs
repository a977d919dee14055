//! Vector kernels: each is compiled twice, for any machine and for the widest vectors of this one.

/// Defines a function that runs compiled for AVX2 where the machine has it.
///
/// Only what is inlined is compiled for it: what the body calls should be `#[inline(always)]`.
/// Fused multiplications are not used: both give the same answer bit for bit.
macro_rules! vectorised {
    ($(#[$meta:meta])* $visible:vis $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $output:ty)? $body:block) => {
        $(#[$meta])*
        // Calling what is compiled for AVX2 is safe only on a machine that has it, which is asked first.
        #[allow(unsafe_code)]
        $visible fn $name($($argument: $type),*) $(-> $output)? {
            #[inline(always)]
            fn plain($($argument: $type),*) $(-> $output)? $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn wide($($argument: $type),*) $(-> $output)? {
                    plain($($argument),*)
                }
                if $crate::simd::has_avx2() {
                    // SAFETY: the machine was just seen to have AVX2.
                    return unsafe { wide($($argument),*) };
                }
            }
            plain($($argument),*)
        }
    };
}
pub(crate) use vectorised;

/// Whether to use AVX2.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(crate) fn has_avx2() -> bool {
    #[cfg(test)]
    if PLAIN.load(std::sync::atomic::Ordering::Relaxed) {
        return false;
    }
    std::arch::is_x86_feature_detected!("avx2")
}

/// Set by tests to run the plain kernels. Tests that run at the same time may be switched as well: their answers are the
/// same.
#[cfg(test)]
pub(crate) static PLAIN: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);
