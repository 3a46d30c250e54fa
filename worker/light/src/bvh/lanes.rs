//! Several numbers at a time: one source for every instruction set.
//!
//! Kernels are written once, against [`Lanes`], and compiled three times: portable arrays, AVX2,
//! AVX-512. Each operation is one correctly rounded IEEE operation a lane, there is no fused
//! multiply-add and no approximate reciprocal, so all three give the same bits.
//!
//! A value of a vector type can only be made with a *proof* ([`Avx2`], [`Avx512`]) that this machine
//! has the instructions; proofs come from detection alone. That is what makes the unsafe blocks sound.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// A vector of `f32`.
///
/// `min` and `max` are those of x86: where either operand is NaN the result is the **second** one.
pub(super) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many numbers.
    const COUNT: usize;
    /// Evidence that the machine can do this.
    type Proof: Copy;
    /// One truth value a lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    fn splat(proof: Self::Proof, x: f32) -> Self;
    /// The first `COUNT` elements; panics if there are fewer.
    fn load(proof: Self::Proof, from: &[f32]) -> Self;
    /// Into the first `COUNT` elements; panics if there are fewer.
    fn store(self, to: &mut [f32]);
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// Negated in the lanes where `by` has its sign bit set.
    fn flip(self, by: Self) -> Self;
    fn le(self, other: Self) -> Self::Mask;
    fn lt(self, other: Self) -> Self::Mask;
    fn ge(self, other: Self) -> Self::Mask;
    /// Lane i in bit i.
    fn bits(mask: Self::Mask) -> u32;
    /// `yes` where the mask is set.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
}

/// An instruction set: vectors of exactly 8 for boxes and triangles, wider ones for bundles of rays.
pub(super) trait Isa: Copy {
    type Eight: Lanes;
    type Wide: Lanes;
    fn eight(self) -> <Self::Eight as Lanes>::Proof;
    fn wide(self) -> <Self::Wide as Lanes>::Proof;
}

/// What the machine at hand can do.
#[derive(Clone, Copy, Debug)]
pub(super) enum Machine {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl Machine {
    /// Everything this machine can do, the fastest last.
    pub fn all() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        let more = [Avx2::detect().map(Self::Avx2), Avx512::detect().map(Self::Avx512)];
        #[cfg(not(target_arch = "x86_64"))]
        let more = [];
        [Some(Self::Portable)].into_iter().chain(more).flatten().collect()
    }

    /// The fastest.
    pub fn detect() -> Self {
        Self::all().pop().unwrap_or(Self::Portable)
    }
}

/// Runs `kernel(isa, arguments…)`, compiled for what the machine can do. The kernel must be
/// `#[inline(always)]` down to the vectors, or it is compiled for plain x86-64.
macro_rules! on_machine {
    ($machine:expr, $kernel:path, ($($name:ident: $type:ty = $value:expr),* $(,)?) -> $output:ty) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn avx2(isa: $crate::bvh::lanes::Avx2, $($name: $type),*) -> $output {
            $kernel(isa, $($name),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn avx512(isa: $crate::bvh::lanes::Avx512, $($name: $type),*) -> $output {
            $kernel(isa, $($name),*)
        }
        match $machine {
            $crate::bvh::lanes::Machine::Portable => $kernel($crate::bvh::lanes::Portable, $($value),*),
            // SAFETY: the proof is only made on machines that have these features.
            #[cfg(target_arch = "x86_64")]
            $crate::bvh::lanes::Machine::Avx2(isa) => unsafe { avx2(isa, $($value),*) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            $crate::bvh::lanes::Machine::Avx512(isa) => unsafe { avx512(isa, $($value),*) },
        }
    }};
}
pub(super) use on_machine;

/// Plain Rust; runs everywhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

impl Isa for Portable {
    type Eight = P8;
    type Wide = P8;
    fn eight(self) -> Self {
        self
    }
    fn wide(self) -> Self {
        self
    }
}

/// Eight numbers in an array.
#[derive(Clone, Copy)]
pub(super) struct P8([f32; 8]);

impl P8 {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
    #[inline(always)]
    fn compare(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        (0..8).fold(0, |bits, i| bits | u32::from(f(self.0[i], other.0[i])) << i)
    }
}

macro_rules! portable_operators {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl $trait for P8 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
    )*};
}
portable_operators!(Add add +, Sub sub -, Mul mul *, Div div /);

impl Lanes for P8 {
    const COUNT: usize = 8;
    type Proof = Portable;
    type Mask = u32;

    #[inline(always)]
    fn splat(_: Portable, x: f32) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    fn load(_: Portable, from: &[f32]) -> Self {
        Self(std::array::from_fn(|i| from[i]))
    }
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        to[..8].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, max)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn flip(self, by: Self) -> Self {
        self.zip(by, flip)
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        self.compare(other, |a, b| a <= b)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.compare(other, |a, b| a < b)
    }
    #[inline(always)]
    fn ge(self, other: Self) -> u32 {
        self.compare(other, |a, b| a >= b)
    }
    #[inline(always)]
    fn bits(mask: u32) -> u32 {
        mask
    }
    #[inline(always)]
    fn select(mask: u32, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| if mask >> i & 1 != 0 { yes.0[i] } else { no.0[i] }))
    }
}

/// The lesser; the second if either is NaN.
#[inline(always)]
pub(super) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater; the second if either is NaN.
#[inline(always)]
pub(super) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `a`, negated if `by` has its sign bit set.
#[inline(always)]
pub(super) fn flip(a: f32, by: f32) -> f32 {
    f32::from_bits(a.to_bits() ^ (by.to_bits() & 0x8000_0000))
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::*;

    /// Proof of AVX2.
    #[derive(Clone, Copy, Debug)]
    pub(in super::super) struct Avx2(());

    /// Proof of AVX-512 F and DQ (and of AVX2).
    #[derive(Clone, Copy, Debug)]
    pub(in super::super) struct Avx512(());

    impl Avx2 {
        /// Looks whether this machine has it.
        pub(in super::super) fn detect() -> Option<Self> {
            let has = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("popcnt");
            has.then_some(Self(()))
        }
    }

    impl Avx512 {
        /// Looks whether this machine has it.
        pub(in super::super) fn detect() -> Option<Self> {
            let has = Avx2::detect().is_some()
                && is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw");
            has.then_some(Self(()))
        }
    }

    impl Isa for Avx2 {
        type Eight = F8;
        type Wide = F8;
        fn eight(self) -> Self {
            self
        }
        fn wide(self) -> Self {
            self
        }
    }

    impl Isa for Avx512 {
        type Eight = F8;
        type Wide = F16;
        fn eight(self) -> Avx2 {
            Avx2(())
        }
        fn wide(self) -> Self {
            self
        }
    }

    /// Eight numbers in an AVX register. A value proves that the machine has AVX2.
    #[derive(Clone, Copy)]
    pub(in super::super) struct F8(__m256);

    /// Lane masks of [`F8`]: all bits or none.
    #[derive(Clone, Copy)]
    pub(in super::super) struct M8(__m256);

    /// Sixteen numbers in an AVX-512 register. A value proves that the machine has AVX-512.
    #[derive(Clone, Copy)]
    pub(in super::super) struct F16(__m512);

    /// SAFETY (of all blocks in this module): intrinsics need the instruction set, and nothing else
    /// unless said; operands and proofs exist only on machines that have it.
    macro_rules! operators {
        ($type:ident: $($trait:ident $method:ident $intrinsic:ident),*) => {$(
            impl $trait for $type {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: the operands prove the instruction set.
                    Self(unsafe { $intrinsic(self.0, other.0) })
                }
            }
        )*};
    }
    operators!(F8: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);
    operators!(M8: BitAnd bitand _mm256_and_ps, BitOr bitor _mm256_or_ps);
    operators!(F16: Add add _mm512_add_ps, Sub sub _mm512_sub_ps, Mul mul _mm512_mul_ps, Div div _mm512_div_ps);

    impl Lanes for F8 {
        const COUNT: usize = 8;
        type Proof = Avx2;
        type Mask = M8;

        #[inline(always)]
        fn splat(_: Avx2, x: f32) -> Self {
            // SAFETY: the proof.
            Self(unsafe { _mm256_set1_ps(x) })
        }
        #[inline(always)]
        fn load(_: Avx2, from: &[f32]) -> Self {
            let from = &from[..8];
            // SAFETY: the proof, and eight readable elements; the load may be unaligned.
            Self(unsafe { _mm256_loadu_ps(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, to: &mut [f32]) {
            let to = &mut to[..8];
            // SAFETY: `self` proves AVX2; eight writable elements; the store may be unaligned.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: `self` proves AVX2.
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: `self` proves AVX2.
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: `self` proves AVX2.
            Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }
        #[inline(always)]
        fn flip(self, by: Self) -> Self {
            // SAFETY: `self` proves AVX2.
            Self(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(by.0, _mm256_set1_ps(-0.0))) })
        }
        #[inline(always)]
        fn le(self, other: Self) -> M8 {
            // SAFETY: `self` proves AVX2.
            M8(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn lt(self, other: Self) -> M8 {
            // SAFETY: `self` proves AVX2.
            M8(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn ge(self, other: Self) -> M8 {
            // SAFETY: `self` proves AVX2.
            M8(unsafe { _mm256_cmp_ps::<_CMP_GE_OQ>(self.0, other.0) })
        }
        #[inline(always)]
        fn bits(mask: M8) -> u32 {
            // SAFETY: the mask proves AVX2.
            unsafe { _mm256_movemask_ps(mask.0) as u32 }
        }
        #[inline(always)]
        fn select(mask: M8, yes: Self, no: Self) -> Self {
            // SAFETY: the mask proves AVX2.
            Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
        }
    }

    impl Lanes for F16 {
        const COUNT: usize = 16;
        type Proof = Avx512;
        type Mask = u16;

        #[inline(always)]
        fn splat(_: Avx512, x: f32) -> Self {
            // SAFETY: the proof.
            Self(unsafe { _mm512_set1_ps(x) })
        }
        #[inline(always)]
        fn load(_: Avx512, from: &[f32]) -> Self {
            let from = &from[..16];
            // SAFETY: the proof, and sixteen readable elements; the load may be unaligned.
            Self(unsafe { _mm512_loadu_ps(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, to: &mut [f32]) {
            let to = &mut to[..16];
            // SAFETY: `self` proves AVX-512; sixteen writable elements; the store may be unaligned.
            unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: `self` proves AVX-512.
            Self(unsafe { _mm512_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: `self` proves AVX-512.
            Self(unsafe { _mm512_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: `self` proves AVX-512.
            Self(unsafe { _mm512_andnot_ps(_mm512_set1_ps(-0.0), self.0) })
        }
        #[inline(always)]
        fn flip(self, by: Self) -> Self {
            // SAFETY: `self` proves AVX-512.
            Self(unsafe { _mm512_xor_ps(self.0, _mm512_and_ps(by.0, _mm512_set1_ps(-0.0))) })
        }
        #[inline(always)]
        fn le(self, other: Self) -> u16 {
            // SAFETY: `self` proves AVX-512.
            unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) }
        }
        #[inline(always)]
        fn lt(self, other: Self) -> u16 {
            // SAFETY: `self` proves AVX-512.
            unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0) }
        }
        #[inline(always)]
        fn ge(self, other: Self) -> u16 {
            // SAFETY: `self` proves AVX-512.
            unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) }
        }
        #[inline(always)]
        fn bits(mask: u16) -> u32 {
            u32::from(mask)
        }
        #[inline(always)]
        fn select(mask: u16, yes: Self, no: Self) -> Self {
            // SAFETY: `yes` proves AVX-512.
            Self(unsafe { _mm512_mask_blend_ps(mask, no.0, yes.0) })
        }
    }
}
