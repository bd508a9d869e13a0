//! Functions compiled for the vector instructions of several kinds of processors, of which the widest that there are run.

#![allow(unsafe_code)]

use std::sync::OnceLock;

use crate::error::{Error, Result};

/// Vector instructions that functions are compiled for, from the narrowest to the widest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Vectors {
    /// None but those of every processor of the architecture.
    Baseline,
    /// AVX2.
    Avx2,
    /// AVX-512: F, BW, DQ and VL.
    Avx512,
}

/// Environment variable with the widest ones to use, to see what other processors do.
const VARIABLE: &str = "FLUXION_LANES";

const NAMES: [(&str, Vectors); 3] =
    [("baseline", Vectors::Baseline), ("avx2", Vectors::Avx2), ("avx512", Vectors::Avx512)];

impl Vectors {
    /// The widest ones that the processor has and the environment variable `FLUXION_LANES` allows; found once.
    #[inline(always)]
    pub fn get() -> Self {
        static CHOSEN: OnceLock<Vectors> = OnceLock::new();
        *CHOSEN.get_or_init(|| Self::detect().min(Self::allowed().unwrap_or(Self::Avx512)))
    }

    /// The widest ones that the environment variable allows. An error if it holds another word than those that are known.
    pub fn allowed() -> Result<Self> {
        let Some(name) = std::env::var_os(VARIABLE) else { return Ok(Self::Avx512) };
        let known = NAMES.iter().find(|(known, _)| name == *known);
        known.map(|&(_, vectors)| vectors).ok_or_else(|| {
            let known = NAMES.map(|(known, _)| known).join(", ");
            Error::BadData(format!("{VARIABLE}={} is not known; there are {known}", name.display()))
        })
    }

    #[cfg(target_arch = "x86_64")]
    fn detect() -> Self {
        use std::arch::is_x86_feature_detected as has;
        if has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl") {
            Self::Avx512
        } else if has!("avx2") && has!("fma") {
            Self::Avx2
        } else {
            Self::Baseline
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn detect() -> Self {
        Self::Baseline
    }
}

/// Has an element of a slice, if there is such, brought into the cache while other things are done.
#[inline(always)]
pub fn prefetch<T>(slice: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(element) = slice.get(index) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every processor of the architecture has the instruction, which has no effect but on the cache.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(element).cast()) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, index);
}

/// Compiles a function once for each of [`Vectors`]; calls run the widest ones. Arguments are names, or tuples and arrays
/// of names.
macro_rules! vectorized {
    (
        $(#[$meta:meta])*
        $visibility:vis fn $name:ident $(<const $n:ident: usize>)? ($($argument:tt: $type:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$meta])*
        #[allow(unsafe_code)]
        $visibility fn $name $(<const $n: usize>)? ($($argument: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
            fn avx512 $(<const $n: usize>)? ($($argument: $type),*) $(-> $result)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn avx2 $(<const $n: usize>)? ($($argument: $type),*) $(-> $result)? $body
            fn baseline $(<const $n: usize>)? ($($argument: $type),*) $(-> $result)? $body
            match $crate::ffi::vectors::Vectors::get() {
                // SAFETY: the processor has these instructions.
                #[cfg(target_arch = "x86_64")]
                $crate::ffi::vectors::Vectors::Avx512 => unsafe { avx512($($argument),*) },
                // SAFETY: as above.
                #[cfg(target_arch = "x86_64")]
                $crate::ffi::vectors::Vectors::Avx2 => unsafe { avx2($($argument),*) },
                _ => baseline($($argument),*),
            }
        }
    };
}
