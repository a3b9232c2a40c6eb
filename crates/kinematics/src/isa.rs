//! The choice of the instruction set, made once while the program runs.
//!
//! A kernel is generic over [`Isa`] and inlined into one function per instruction set, but for what it hands to
//! [`Isa::call`], so that the compiler vectorises its plain loops with the registers of that set.

use std::sync::OnceLock;

use crate::error::KinematicsError;
use crate::lane::{LANES, Lane, Pick, Short};

/// What differs between instruction sets: whether a multiplication fuses with an addition, and how rows are moved.
pub trait Isa {
    /// Whether sixteen lanes and what is added to them stay in registers; else six do.
    const MANY_REGISTERS: bool = false;

    /// Run a kernel that is compiled once for this instruction set, and not wherever it is called.
    ///
    /// For what is large, or called in several places: kernels that hold all they call take minutes to compile.
    fn call<K: Kernel>(kernel: K) -> K::Output;

    /// a b + c, with one rounding only where the instruction set has it.
    fn mul_add(a: Lane, b: Lane, c: Lane) -> Lane;

    /// The same in single precision.
    fn mul_add_short(a: Short, b: Short, c: Short) -> Short;

    /// The same numbers in double precision.
    #[inline(always)]
    fn widen(short: Short) -> Lane {
        let mut out = Lane::ZERO;
        for (out, value) in out.0.iter_mut().zip(&short.0) {
            *out = f64::from(*value);
        }
        out
    }

    /// The same numbers rounded to single precision.
    #[inline(always)]
    fn narrow(lane: Lane) -> Short {
        let mut out = Short::ZERO;
        for (out, value) in out.0.iter_mut().zip(&lane.0) {
            *out = *value as f32;
        }
        out
    }

    /// Swap rows and columns of 8 x 8 numbers.
    #[inline(always)]
    fn transpose(block: &mut [Lane; LANES]) {
        let source = *block;
        for (i, lane) in block.iter_mut().enumerate() {
            for k in 0..LANES {
                lane.0[k] = source[k].0[i];
            }
        }
    }

    /// Eight numbers out of sixteen.
    #[inline(always)]
    fn pick(low: &Lane, high: &Lane, pick: &Pick) -> Lane {
        let mut out = Lane::ZERO;
        for (i, out) in out.0.iter_mut().enumerate() {
            *out = pick.of(i, low, high).unwrap_or(0.0);
        }
        out
    }

    /// Add eight numbers out of sixteen to `to`, or as many as it has.
    #[inline(always)]
    fn add_picked(low: &Lane, high: &Lane, pick: &Pick, to: &mut [f64]) {
        // Number by number: where lanes are no single registers, to put them together takes longer than to add them.
        for (i, to) in to.iter_mut().enumerate().take(LANES) {
            if let Some(value) = pick.of(i, low, high) {
                *to += value;
            }
        }
    }

    /// Write a whole line of results that is not read again soon; where it can, past the caches.
    #[inline(always)]
    fn stream(line: &Lane, to: &mut [f64; LANES]) {
        *to = line.0;
    }

    /// Let other threads see what was streamed.
    #[inline(always)]
    fn fence() {}
}

/// Work that is compiled once for each instruction set.
///
/// `run` and everything it calls in its loops must be `#[inline(always)]`: what is not inlined is compiled
/// for the plainest machine, and every `mul_add` in it becomes a library call. That goes for larger closures too,
/// such as those given to `array::map` and `array::from_fn`: write loops. What is large goes through [`Isa::call`].
pub trait Kernel {
    /// What the work gives back.
    type Output;

    /// Do the work.
    fn run<I: Isa>(self) -> Self::Output;
}

/// An instruction set to choose, the lowest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// What every machine of the compiled architecture has.
    Baseline,
    /// 256-bit vectors and fused multiplication (x86-64).
    Avx2,
    /// 512-bit vectors (x86-64).
    Avx512,
}

impl InstructionSet {
    /// Every set, the lowest first.
    pub const ALL: [InstructionSet; 3] = [Self::Baseline, Self::Avx2, Self::Avx512];

    /// The highest set this machine has.
    pub fn detected() -> InstructionSet {
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            let avx512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw");
            match (avx2, avx512) {
                (true, true) => return Self::Avx512,
                (true, false) => return Self::Avx2,
                _ => {}
            }
        }
        Self::Baseline
    }

    /// The set to use: the detected one, or a lower one asked for by `TRUEARM_ISA`.
    ///
    /// # Errors
    /// [`KinematicsError::UnknownInstructionSet`] if the variable is set to anything but `baseline`, `avx2`
    /// or `avx512`.
    pub fn from_environment() -> Result<InstructionSet, KinematicsError> {
        let Some(text) = std::env::var_os("TRUEARM_ISA") else {
            return Ok(Self::detected());
        };
        let asked = match text.to_string_lossy().as_ref() {
            "baseline" => Self::Baseline,
            "avx2" => Self::Avx2,
            "avx512" => Self::Avx512,
            other => return Err(KinematicsError::UnknownInstructionSet(other.to_owned())),
        };
        Ok(asked.min(Self::detected()))
    }
}

struct Plain;

/// Runs a kernel that was compiled for every machine.
#[inline(never)]
fn run_plain<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Plain>()
}

impl Isa for Plain {
    #[inline(always)]
    fn call<K: Kernel>(kernel: K) -> K::Output {
        run_plain(kernel)
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn mul_add(a: Lane, b: Lane, c: Lane) -> Lane {
        crate::x86::mul_add_sse2(a, b, c)
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn mul_add_short(a: Short, b: Short, c: Short) -> Short {
        crate::x86::mul_add_short_sse2(a, b, c)
    }

    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    fn mul_add_short(a: Short, b: Short, c: Short) -> Short {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = if cfg!(target_arch = "aarch64") {
                a.0[i].mul_add(b.0[i], c.0[i])
            } else {
                a.0[i] * b.0[i] + c.0[i]
            };
        }
        Short(out)
    }

    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    #[inline(always)]
    fn mul_add(a: Lane, b: Lane, c: Lane) -> Lane {
        a * b + c
    }

    #[cfg(target_arch = "aarch64")]
    #[inline(always)]
    fn mul_add(a: Lane, b: Lane, c: Lane) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = a.0[i].mul_add(b.0[i], c.0[i]);
        }
        Lane(out)
    }
}

#[cfg(target_arch = "x86_64")]
mod vector {
    use super::{Isa, Kernel, LANES, Lane, Pick, Short};
    use crate::x86;

    pub struct Avx2;
    pub struct Avx512;

    impl Isa for Avx2 {
        #[inline(always)]
        fn call<K: Kernel>(kernel: K) -> K::Output {
            // SAFETY: this instruction set is only used on processors that have it.
            unsafe { run_avx2(kernel) }
        }

        #[inline(always)]
        fn mul_add(a: Lane, b: Lane, c: Lane) -> Lane {
            // SAFETY: this instruction set is only used on processors that have it.
            unsafe { x86::mul_add_avx2(a, b, c) }
        }

        #[inline(always)]
        fn mul_add_short(a: Short, b: Short, c: Short) -> Short {
            // SAFETY: as above.
            unsafe { x86::mul_add_short_avx2(a, b, c) }
        }

        #[inline(always)]
        fn widen(short: Short) -> Lane {
            // SAFETY: as above.
            unsafe { x86::widen_avx2(short) }
        }

        #[inline(always)]
        fn narrow(lane: Lane) -> Short {
            // SAFETY: as above.
            unsafe { x86::narrow_avx2(lane) }
        }

        #[inline(always)]
        fn transpose(block: &mut [Lane; LANES]) {
            // SAFETY: this instruction set is only used on processors that have it.
            unsafe { x86::transpose_avx(block) }
        }

        #[inline(always)]
        fn stream(line: &Lane, to: &mut [f64; LANES]) {
            // SAFETY: as above.
            unsafe { x86::stream_avx(line, to) }
        }

        #[inline(always)]
        fn fence() {
            x86::fence();
        }
    }

    impl Isa for Avx512 {
        const MANY_REGISTERS: bool = true;

        #[inline(always)]
        fn call<K: Kernel>(kernel: K) -> K::Output {
            // SAFETY: this instruction set is only used on processors that have it.
            unsafe { run_avx512(kernel) }
        }

        #[inline(always)]
        fn mul_add(a: Lane, b: Lane, c: Lane) -> Lane {
            // SAFETY: this instruction set is only used on processors that have it.
            unsafe { x86::mul_add_avx512(a, b, c) }
        }

        #[inline(always)]
        fn mul_add_short(a: Short, b: Short, c: Short) -> Short {
            // SAFETY: as above.
            unsafe { x86::mul_add_short_avx2(a, b, c) }
        }

        #[inline(always)]
        fn widen(short: Short) -> Lane {
            // SAFETY: as above.
            unsafe { x86::widen_avx512(short) }
        }

        #[inline(always)]
        fn narrow(lane: Lane) -> Short {
            // SAFETY: as above.
            unsafe { x86::narrow_avx512(lane) }
        }

        #[inline(always)]
        fn transpose(block: &mut [Lane; LANES]) {
            // SAFETY: this instruction set is only used on processors that have it.
            unsafe { x86::transpose_avx512(block) }
        }

        #[inline(always)]
        fn pick(low: &Lane, high: &Lane, pick: &Pick) -> Lane {
            // SAFETY: as above.
            unsafe { x86::pick_avx512(low, high, pick) }
        }

        #[inline(always)]
        fn add_picked(low: &Lane, high: &Lane, pick: &Pick, to: &mut [f64]) {
            // SAFETY: as above.
            unsafe { x86::add_to_avx512(&x86::pick_avx512(low, high, pick), to) }
        }

        #[inline(always)]
        fn stream(line: &Lane, to: &mut [f64; LANES]) {
            // SAFETY: as above.
            unsafe { x86::stream_avx512(line, to) }
        }

        #[inline(always)]
        fn fence() {
            x86::fence();
        }
    }

    /// Runs a kernel that was compiled for AVX2.
    #[target_feature(enable = "avx2,fma")]
    #[inline(never)]
    pub fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx2>()
    }

    /// Runs a kernel that was compiled for AVX-512.
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
    #[inline(never)]
    pub fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx512>()
    }
}

/// Run a kernel with the best instruction set of this machine, or the lower one that `TRUEARM_ISA` names.
///
/// The variable is read once; a value that [`InstructionSet::from_environment`] refuses is the business of
/// the program's start and is taken here as not set.
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    static CHOSEN: OnceLock<InstructionSet> = OnceLock::new();
    let chosen =
        *CHOSEN.get_or_init(|| InstructionSet::from_environment().unwrap_or(InstructionSet::detected()));
    dispatch_on(chosen, kernel)
}

/// Run a kernel with one instruction set, or with the best this machine has if that is lower.
pub fn dispatch_on<K: Kernel>(set: InstructionSet, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    match set.min(InstructionSet::detected()) {
        // SAFETY: the processor has just been found to have these instructions.
        InstructionSet::Avx512 => return unsafe { vector::run_avx512(kernel) },
        // SAFETY: as above.
        InstructionSet::Avx2 => return unsafe { vector::run_avx2(kernel) },
        InstructionSet::Baseline => {}
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = set;
    run_plain(kernel)
}
