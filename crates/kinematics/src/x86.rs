//! The few loops that the compiler does not vectorise by itself: transposition in registers, and stores past the caches.
#![cfg(target_arch = "x86_64")]

use std::arch::x86_64::{
    __m128, __m128d, __m256, __m256d, __m512d, _mm_add_pd, _mm_add_ps, _mm_mul_pd, _mm_mul_ps, _mm_sfence,
    _mm256_cvtpd_ps, _mm256_cvtps_pd, _mm256_fmadd_pd, _mm256_fmadd_ps, _mm256_loadu_pd,
    _mm256_permute2f128_pd, _mm256_storeu_pd, _mm256_stream_pd, _mm256_unpackhi_pd, _mm256_unpacklo_pd,
    _mm512_add_pd, _mm512_cvtpd_ps, _mm512_cvtps_pd, _mm512_fmadd_pd, _mm512_loadu_epi64, _mm512_loadu_pd,
    _mm512_mask_storeu_pd, _mm512_maskz_loadu_pd, _mm512_maskz_permutex2var_pd, _mm512_shuffle_f64x2,
    _mm512_storeu_pd, _mm512_stream_pd, _mm512_unpackhi_pd, _mm512_unpacklo_pd,
};
use std::mem::transmute;

use crate::lane::{LANES, Lane, Pick, Short};

type Eight = __m512d;
type Fours = [__m256d; 2];
type Twos = [__m128d; 4];

/// Bytes of a cache line, and of a lane.
const LINE: usize = 64;

/// a b + c with one rounding.
///
/// Said in vectors it keeps the plain operations around it in vectors: the compiler looks back through a dozen scalar
/// operations only before it gives up joining them.
///
/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
pub unsafe fn mul_add_avx512(a: Lane, b: Lane, c: Lane) -> Lane {
    // SAFETY: a lane is a vector of eight f64; the caller vouches for the instruction.
    unsafe {
        let [a, b, c] = transmute::<[Lane; 3], [Eight; 3]>([a, b, c]);
        transmute::<Eight, Lane>(_mm512_fmadd_pd(a, b, c))
    }
}

/// a b + c with one rounding, see [`mul_add_avx512`].
///
/// # Safety
/// The processor must have AVX2 and FMA.
#[inline(always)]
pub unsafe fn mul_add_avx2(a: Lane, b: Lane, c: Lane) -> Lane {
    // SAFETY: a lane is two vectors of four f64; the caller vouches for the instruction.
    unsafe {
        let [a, b, c] = transmute::<[Lane; 3], [Fours; 3]>([a, b, c]);
        transmute::<Fours, Lane>([_mm256_fmadd_pd(a[0], b[0], c[0]), _mm256_fmadd_pd(a[1], b[1], c[1])])
    }
}

/// a b + c with two roundings, see [`mul_add_avx512`].
#[inline(always)]
pub fn mul_add_sse2(a: Lane, b: Lane, c: Lane) -> Lane {
    // SAFETY: a lane is four vectors of two f64, and every x86-64 machine has the instructions.
    unsafe {
        let [a, b, c] = transmute::<[Lane; 3], [Twos; 3]>([a, b, c]);
        transmute::<Twos, Lane>([
            _mm_add_pd(_mm_mul_pd(a[0], b[0]), c[0]),
            _mm_add_pd(_mm_mul_pd(a[1], b[1]), c[1]),
            _mm_add_pd(_mm_mul_pd(a[2], b[2]), c[2]),
            _mm_add_pd(_mm_mul_pd(a[3], b[3]), c[3]),
        ])
    }
}

/// a b + c in single precision with one rounding, see [`mul_add_avx512`].
///
/// # Safety
/// The processor must have AVX2 and FMA.
#[inline(always)]
pub unsafe fn mul_add_short_avx2(a: Short, b: Short, c: Short) -> Short {
    // SAFETY: a short lane is a vector of eight f32; the caller vouches for the instruction.
    unsafe {
        let [a, b, c] = transmute::<[Short; 3], [__m256; 3]>([a, b, c]);
        transmute::<__m256, Short>(_mm256_fmadd_ps(a, b, c))
    }
}

/// a b + c in single precision with two roundings, see [`mul_add_avx512`].
#[inline(always)]
pub fn mul_add_short_sse2(a: Short, b: Short, c: Short) -> Short {
    // SAFETY: a short lane is two vectors of four f32, and every x86-64 machine has the instructions.
    unsafe {
        let [a, b, c] = transmute::<[Short; 3], [[__m128; 2]; 3]>([a, b, c]);
        transmute::<[__m128; 2], Short>([
            _mm_add_ps(_mm_mul_ps(a[0], b[0]), c[0]),
            _mm_add_ps(_mm_mul_ps(a[1], b[1]), c[1]),
        ])
    }
}

/// Eight numbers in double precision, see [`crate::Isa::widen`].
///
/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
pub unsafe fn widen_avx512(short: Short) -> Lane {
    // SAFETY: a short lane is a vector of eight f32; the caller vouches for the instruction.
    unsafe { transmute::<Eight, Lane>(_mm512_cvtps_pd(transmute::<Short, __m256>(short))) }
}

/// Eight numbers in double precision, see [`crate::Isa::widen`].
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub unsafe fn widen_avx2(short: Short) -> Lane {
    // SAFETY: a short lane is two vectors of four f32; the caller vouches for the instruction.
    unsafe {
        let [low, high] = transmute::<Short, [__m128; 2]>(short);
        transmute::<Fours, Lane>([_mm256_cvtps_pd(low), _mm256_cvtps_pd(high)])
    }
}

/// Eight numbers rounded to single precision, see [`crate::Isa::narrow`].
///
/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
pub unsafe fn narrow_avx512(lane: Lane) -> Short {
    // SAFETY: a lane is a vector of eight f64; the caller vouches for the instruction.
    unsafe { transmute::<__m256, Short>(_mm512_cvtpd_ps(transmute::<Lane, Eight>(lane))) }
}

/// Eight numbers rounded to single precision, see [`crate::Isa::narrow`].
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub unsafe fn narrow_avx2(lane: Lane) -> Short {
    // SAFETY: a lane is two vectors of four f64; the caller vouches for the instruction.
    unsafe {
        let [low, high] = transmute::<Lane, Fours>(lane);
        transmute::<[__m128; 2], Short>([_mm256_cvtpd_ps(low), _mm256_cvtpd_ps(high)])
    }
}

/// Eight numbers out of sixteen, see [`crate::Isa::pick`].
///
/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
pub unsafe fn pick_avx512(low: &Lane, high: &Lane, pick: &Pick) -> Lane {
    // SAFETY: loads are of the eight numbers of a lane or a pick; the caller vouches for the instructions.
    unsafe {
        let from = _mm512_loadu_epi64(pick.from.as_ptr().cast());
        let (low, high) = (_mm512_loadu_pd(low.0.as_ptr()), _mm512_loadu_pd(high.0.as_ptr()));
        transmute::<Eight, Lane>(_mm512_maskz_permutex2var_pd(pick.taken, low, from, high))
    }
}

/// Adds the first numbers of a lane to `to`, up to eight.
///
/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
pub unsafe fn add_to_avx512(lane: &Lane, to: &mut [f64]) {
    let count = to.len().min(LANES);
    let mask = (0xff_u16 >> (LANES - count)) as u8;
    // SAFETY: the mask leaves the numbers that `to` has; the caller vouches for the instructions.
    unsafe {
        let before = _mm512_maskz_loadu_pd(mask, to.as_ptr());
        let after = _mm512_add_pd(before, _mm512_loadu_pd(lane.0.as_ptr()));
        _mm512_mask_storeu_pd(to.as_mut_ptr(), mask, after);
    }
}

/// Transpose 8 x 8 numbers.
///
/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
pub unsafe fn transpose_avx512(block: &mut [Lane; LANES]) {
    // SAFETY: loads and stores are of the eight numbers of a lane; the caller vouches for the instructions.
    unsafe {
        let row = |i: usize| _mm512_loadu_pd(block[i].0.as_ptr());
        let low = |i: usize| _mm512_unpacklo_pd(row(2 * i), row(2 * i + 1));
        let high = |i: usize| _mm512_unpackhi_pd(row(2 * i), row(2 * i + 1));
        let even = quarters([low(0), low(1), low(2), low(3)]);
        let odd = quarters([high(0), high(1), high(2), high(3)]);
        for k in 0..4 {
            _mm512_storeu_pd(block[2 * k].0.as_mut_ptr(), even[k]);
            _mm512_storeu_pd(block[2 * k + 1].0.as_mut_ptr(), odd[k]);
        }
    }
}

/// Transpose 4 x 4 pairs of numbers.
#[inline(always)]
unsafe fn quarters(x: [__m512d; 4]) -> [__m512d; 4] {
    // SAFETY: as the caller's.
    unsafe {
        let front = [_mm512_shuffle_f64x2::<0x88>(x[0], x[1]), _mm512_shuffle_f64x2::<0x88>(x[2], x[3])];
        let back = [_mm512_shuffle_f64x2::<0xdd>(x[0], x[1]), _mm512_shuffle_f64x2::<0xdd>(x[2], x[3])];
        [
            _mm512_shuffle_f64x2::<0x88>(front[0], front[1]),
            _mm512_shuffle_f64x2::<0x88>(back[0], back[1]),
            _mm512_shuffle_f64x2::<0xdd>(front[0], front[1]),
            _mm512_shuffle_f64x2::<0xdd>(back[0], back[1]),
        ]
    }
}

/// Transpose 8 x 8 numbers.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub unsafe fn transpose_avx(block: &mut [Lane; LANES]) {
    let source = *block;
    for (row, column) in [(0, 0), (0, 4), (4, 0), (4, 4)] {
        // SAFETY: four numbers from index 0 or 4 of a lane; the caller vouches for the instructions.
        unsafe {
            let r = |i: usize| _mm256_loadu_pd(source[row + i].0.as_ptr().add(column));
            let turned = fours([r(0), r(1), r(2), r(3)]);
            for (i, value) in turned.into_iter().enumerate() {
                _mm256_storeu_pd(block[column + i].0.as_mut_ptr().add(row), value);
            }
        }
    }
}

/// Transpose 4 x 4 numbers.
#[inline(always)]
unsafe fn fours(r: [__m256d; 4]) -> [__m256d; 4] {
    // SAFETY: as the caller's.
    unsafe {
        let (a, b) = (_mm256_unpacklo_pd(r[0], r[1]), _mm256_unpackhi_pd(r[0], r[1]));
        let (c, d) = (_mm256_unpacklo_pd(r[2], r[3]), _mm256_unpackhi_pd(r[2], r[3]));
        [
            _mm256_permute2f128_pd::<0x20>(a, c),
            _mm256_permute2f128_pd::<0x20>(b, d),
            _mm256_permute2f128_pd::<0x31>(a, c),
            _mm256_permute2f128_pd::<0x31>(b, d),
        ]
    }
}

/// Write a whole cache line past the caches, or plainly where `to` does not begin one.
///
/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
pub unsafe fn stream_avx512(line: &Lane, to: &mut [f64; LANES]) {
    if !to.as_ptr().addr().is_multiple_of(LINE) {
        *to = line.0;
        return;
    }
    // SAFETY: the address is that of eight numbers and has just been found aligned.
    unsafe { _mm512_stream_pd(to.as_mut_ptr(), _mm512_loadu_pd(line.0.as_ptr())) }
}

/// Write a whole cache line past the caches, or plainly where `to` does not begin one.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub unsafe fn stream_avx(line: &Lane, to: &mut [f64; LANES]) {
    if !to.as_ptr().addr().is_multiple_of(LINE) {
        *to = line.0;
        return;
    }
    // SAFETY: the addresses are of two times four numbers and have just been found aligned.
    unsafe {
        _mm256_stream_pd(to.as_mut_ptr(), _mm256_loadu_pd(line.0.as_ptr()));
        _mm256_stream_pd(to.as_mut_ptr().add(4), _mm256_loadu_pd(line.0.as_ptr().add(4)));
    }
}

/// Let other threads see what was streamed before what follows.
#[inline(always)]
pub fn fence() {
    // SAFETY: every x86-64 machine has the instruction.
    unsafe { _mm_sfence() }
}
