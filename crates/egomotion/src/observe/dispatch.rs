//! The same kernel compiled twice: for any machine, and for the widest vectors of this one.

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
                if $crate::observe::dispatch::has_avx2() {
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
    if tests::PLAIN.load(std::sync::atomic::Ordering::Relaxed) {
        return false;
    }
    std::arch::is_x86_feature_detected!("avx2")
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use crate::geometry::{Grid, StereoRig};
    use crate::observe::StereoPyramid;
    use crate::observe::tracks::{Hints, TrackOptions, stereo_tracks};

    /// Tests that run at the same time may be switched as well: their answers are the same.
    pub(in crate::observe) static PLAIN: AtomicBool = AtomicBool::new(false);

    #[test]
    fn wide_and_plain_kernels_give_the_same_bits() {
        let grey = |u: f64, v: f64| {
            let wave = |a: f64, b: f64, c: f64| (a * u + b * v + c).sin() * (b * u - a * v).cos();
            (120.0
                + 30.0 * wave(0.31, 0.12, 0.0)
                + 25.0 * wave(-0.13, 0.26, 1.0)
                + 40.0 * wave(0.05, 0.07, 2.0)) as f32
        };
        let image = |shift: f64| Grid::from_fn(213, 151, |u, v| grey(u as f64 + shift, v as f64));
        let rig = StereoRig::new(300.0, (99.5, 74.5), 0.1, (213, 151)).unwrap();
        let all = || {
            let before = StereoPyramid::new(&image(0.0), &image(9.3), 4);
            let after = StereoPyramid::new(&image(0.7), &image(10.0), 4);
            let tracks = stereo_tracks(&before, &after, &rig, Hints::default(), &TrackOptions::default());
            (before.left, before.right_spline, tracks)
        };
        let wide = all();
        PLAIN.store(true, Ordering::Relaxed);
        let plain = all();
        PLAIN.store(false, Ordering::Relaxed);
        assert!(wide.2.len() > 100, "{}", wide.2.len());
        assert!(wide.0 == plain.0 && wide.1 == plain.1);
        assert_eq!(wide.2, plain.2);
    }
}
