//! Bytes side by side: one operation acts on 32 of them at once.
//!
//! [`Bytes`] is a 256-bit register where the processor has AVX2, an array everywhere else. Both compute
//! the same integers.

/// Bytes in a vector.
pub(crate) const LANES: usize = 32;

/// So many bytes, on which one operation acts at once.
pub(crate) trait Bytes: Copy {
    /// The same byte everywhere.
    fn splat(value: u8) -> Self;
    /// From an array.
    fn from_array(bytes: [u8; LANES]) -> Self;
    /// As an array.
    fn to_array(self) -> [u8; LANES];
    /// The lesser of each two.
    fn min(self, other: Self) -> Self;
    /// Sum, 255 at most.
    fn plus(self, other: Self) -> Self;
    /// Difference, 0 at least.
    fn minus(self, other: Self) -> Self;
    /// Number of bits in which each byte differs from that of `other`.
    fn distance(self, other: Self) -> Self;
    /// Larger of each two.
    fn max(self, other: Self) -> Self;
    /// The least byte, everywhere.
    fn least(self) -> Self;
    /// Bit i is set if byte i is that of `other` or less.
    fn at_most(self, other: Self) -> u32;
    /// Each byte moved up by one; the last of `before` becomes the first.
    fn moved_up(self, before: Self) -> Self;
    /// Each byte moved down by one; the first of `after` becomes the last.
    fn moved_down(self, after: Self) -> Self;

    /// The bytes from `start` on.
    #[inline(always)]
    fn load(bytes: &[u8], start: usize) -> Self {
        let mut lanes = [0; LANES];
        lanes.copy_from_slice(&bytes[start..start + LANES]);
        Self::from_array(lanes)
    }

    /// Write to the bytes from `start` on.
    #[inline(always)]
    fn store(self, bytes: &mut [u8], start: usize) {
        bytes[start..start + LANES].copy_from_slice(&self.to_array());
    }
}

/// The plain version: an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Array([u8; LANES]);

impl Array {
    #[inline(always)]
    fn with(mut self, other: Self, f: impl Fn(u8, u8) -> u8) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        self
    }
}

impl Bytes for Array {
    #[inline(always)]
    fn splat(value: u8) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    fn from_array(bytes: [u8; LANES]) -> Self {
        Self(bytes)
    }
    #[inline(always)]
    fn to_array(self) -> [u8; LANES] {
        self.0
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, u8::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, u8::max)
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.with(other, u8::saturating_add)
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.with(other, u8::saturating_sub)
    }
    #[inline(always)]
    fn distance(self, other: Self) -> Self {
        self.with(other, |a, b| (a ^ b).count_ones() as u8)
    }
    #[inline(always)]
    fn least(self) -> Self {
        Self::splat(self.0.into_iter().fold(u8::MAX, u8::min))
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> u32 {
        self.0.iter().zip(&other.0).enumerate().fold(0, |bits, (i, (a, b))| bits | u32::from(a <= b) << i)
    }
    #[inline(always)]
    fn moved_up(self, before: Self) -> Self {
        let mut moved = [before.0[LANES - 1]; LANES];
        moved[1..].copy_from_slice(&self.0[..LANES - 1]);
        Self(moved)
    }
    #[inline(always)]
    fn moved_down(self, after: Self) -> Self {
        let mut moved = [after.0[0]; LANES];
        moved[..LANES - 1].copy_from_slice(&self.0[1..]);
        Self(moved)
    }
}

/// The version for AVX2: a register.
#[cfg(target_arch = "x86_64")]
pub(super) mod avx2 {
    #![allow(unsafe_code, reason = "registers make a frame five times as fast; see `super::super::widest`")]

    use std::arch::x86_64::*;

    use super::{Bytes, LANES};

    /// 32 bytes in a register. Only [`widest`](super::super::widest) names it, after asking for AVX2.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Register(__m256i);

    // SAFETY, of all that follows: the processor has AVX2, because `widest` has asked; arrays of 32
    // bytes and the register are of one size, and every pattern of bits is a value of either.
    impl Bytes for Register {
        #[inline(always)]
        fn splat(value: u8) -> Self {
            Self(unsafe { _mm256_set1_epi8(value as i8) })
        }
        #[inline(always)]
        fn from_array(bytes: [u8; LANES]) -> Self {
            Self(unsafe { std::mem::transmute::<[u8; LANES], __m256i>(bytes) })
        }
        #[inline(always)]
        fn to_array(self) -> [u8; LANES] {
            unsafe { std::mem::transmute::<__m256i, [u8; LANES]>(self.0) }
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            Self(unsafe { _mm256_min_epu8(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Self(unsafe { _mm256_max_epu8(self.0, other.0) })
        }
        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            Self(unsafe { _mm256_adds_epu8(self.0, other.0) })
        }
        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            Self(unsafe { _mm256_subs_epu8(self.0, other.0) })
        }
        #[inline(always)]
        fn distance(self, other: Self) -> Self {
            // The bits of each half byte, looked up.
            const COUNTS: [u8; LANES] = {
                let mut counts = [0; LANES];
                let mut i = 0;
                while i < LANES {
                    counts[i] = (i % 16).count_ones() as u8;
                    i += 1;
                }
                counts
            };
            let counts = Self::from_array(COUNTS).0;
            unsafe {
                let nibble = _mm256_set1_epi8(15);
                let bits = _mm256_xor_si256(self.0, other.0);
                let low = _mm256_shuffle_epi8(counts, _mm256_and_si256(bits, nibble));
                let high = _mm256_and_si256(_mm256_srli_epi16::<4>(bits), nibble);
                Self(_mm256_add_epi8(low, _mm256_shuffle_epi8(counts, high)))
            }
        }
        #[inline(always)]
        fn least(self) -> Self {
            unsafe {
                let half =
                    _mm_min_epu8(_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0));
                // The least of each two bytes as 16 bits, of which one instruction finds the least.
                let pairs = _mm_min_epu8(half, _mm_srli_epi16::<8>(half));
                Self(_mm256_broadcastb_epi8(_mm_minpos_epu16(pairs)))
            }
        }
        #[inline(always)]
        fn at_most(self, other: Self) -> u32 {
            let lesser = self.min(other).0;
            unsafe { _mm256_movemask_epi8(_mm256_cmpeq_epi8(self.0, lesser)) as u32 }
        }
        #[inline(always)]
        fn moved_up(self, before: Self) -> Self {
            unsafe {
                // (high half of `before`, low half of self)
                let middle = _mm256_permute2x128_si256::<0x21>(before.0, self.0);
                Self(_mm256_alignr_epi8::<15>(self.0, middle))
            }
        }
        #[inline(always)]
        fn moved_down(self, after: Self) -> Self {
            unsafe {
                // (high half of self, low half of `after`)
                let middle = _mm256_permute2x128_si256::<0x21>(self.0, after.0);
                Self(_mm256_alignr_epi8::<1>(middle, self.0))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Kernel, widest};

    /// All operations of two vectors, one after the other.
    struct Operations([u8; LANES], [u8; LANES]);

    impl Kernel for Operations {
        type Output = (Vec<[u8; LANES]>, u32);
        fn run<B: Bytes>(self) -> Self::Output {
            let (a, b) = (B::from_array(self.0), B::from_array(self.1));
            let answers = [
                a.min(b),
                a.max(b),
                a.plus(b),
                a.minus(b),
                a.distance(b),
                a.least(),
                a.moved_up(b),
                a.moved_down(b),
                B::splat(self.0[3]),
            ];
            (answers.map(B::to_array).to_vec(), a.at_most(b))
        }
    }

    #[test]
    fn registers_compute_what_arrays_do() {
        let mut state = 7_u32;
        let mut bytes = || {
            let mut next = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Ties and the ends of the range come often.
                [(state >> 24) as u8, 0, 255, 128, 127][(state >> 8) as usize % 9 % 5]
            };
            std::array::from_fn::<u8, LANES, _>(|_| next())
        };
        for _ in 0..500 {
            let (a, b) = (bytes(), bytes());
            assert_eq!(widest(Operations(a, b)), Operations(a, b).run::<Array>());
        }
    }

    #[test]
    fn bytes_are_what_they_say() {
        let a: [u8; LANES] = std::array::from_fn(|i| 8 * i as u8 + 3);
        let b: [u8; LANES] = std::array::from_fn(|i| 250 - 7 * i as u8);
        let (answers, at_most) = Operations(a, b).run::<Array>();
        let expected = |f: &dyn Fn(usize) -> u8| std::array::from_fn::<u8, LANES, _>(f);
        assert_eq!(answers[2], expected(&|i| (u16::from(a[i]) + u16::from(b[i])).min(255) as u8));
        assert_eq!(answers[3], expected(&|i| (i16::from(a[i]) - i16::from(b[i])).max(0) as u8));
        assert_eq!(answers[5], [3; LANES]);
        assert_eq!(answers[6], expected(&|i| if i == 0 { b[31] } else { a[i - 1] }));
        assert_eq!(answers[7], expected(&|i| if i == 31 { b[0] } else { a[i + 1] }));
        assert_eq!(at_most, (0..32).filter(|&i| a[i] <= b[i]).map(|i| 1 << i).sum::<u32>());
    }
}
