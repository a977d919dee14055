//! Vector kernels: each is compiled twice, for any machine and for AVX2, and the machine is asked at every call.
//!
//! [`vectorised!`] defines a function that is compiled so; [`Kernel`] is for loops over [`Bytes`], whose
//! operations the compiler would not find by itself. Nothing else in the workspace asks for a processor's instructions.

mod bytes;

pub(crate) use bytes::{Array, Bytes, LANES};

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

/// A loop over [`Bytes`], worth compiling for wide vectors; [`widest`] runs it.
///
/// `run` and all that it calls in its loop must be `#[inline(always)]`: only then is it compiled
/// anew, with the instructions of the processor it runs on. Integers give the same answer with any
/// instructions, and so do floating-point numbers, of which Rust fuses and reorders nothing.
pub(crate) trait Kernel {
    /// What it answers.
    type Output;
    /// The loop, on vectors of this kind.
    fn run<B: Bytes>(self) -> Self::Output;
}

/// Run a kernel with the widest vectors of this processor.
pub(crate) fn widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if has_avx2()
        && std::arch::is_x86_feature_detected!("bmi1")
        && std::arch::is_x86_feature_detected!("popcnt")
    {
        // Of the three no processor with AVX2 lacks any.
        #[target_feature(enable = "avx2,bmi1,popcnt")]
        fn wide<K: Kernel>(kernel: K) -> K::Output {
            kernel.run::<bytes::avx2::Register>()
        }
        #[allow(unsafe_code, reason = "the lines above ask whether the processor has the instructions")]
        // SAFETY: it has them.
        return unsafe { wide(kernel) };
    }
    kernel.run::<Array>()
}

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
