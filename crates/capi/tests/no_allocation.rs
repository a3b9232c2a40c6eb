//! After loading nothing allocates: counted by the allocator of this test.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ptr::{null, null_mut};

use common::{BEYOND, HOME, JOINTS, Rig};
use truearm::*;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: as for this function.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: as for this function.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnOnce()) -> usize {
    let before = COUNT.with(Cell::get);
    work();
    COUNT.with(Cell::get) - before
}

#[test]
fn allocations_are_counted() {
    assert!(allocations(|| drop(std::hint::black_box(vec![1.0; 8]))) >= 2);
}

#[test]
fn corrections_predictions_and_streams_allocate_nothing() {
    let rig = Rig::new();
    let stream = rig.stream();
    let mut broken = HOME;
    broken[2] = f64::NAN;
    let found = allocations(|| {
        for q in [&HOME, &BEYOND, &broken, &[0.0; JOINTS]] {
            std::hint::black_box(rig.correct(q));
            let mut out = [0.0; JOINTS];
            // SAFETY: all pointers are to memory of the sizes given.
            unsafe {
                let (to, state) = (out.as_mut_ptr(), null_mut());
                truearm_stream_step(stream, q.as_ptr(), JOINTS, null(), 0, 0.002, to, JOINTS, state);
                truearm_stream_step(stream, null(), 0, null(), 0, 9.0, to, JOINTS, state);
                truearm_stream_switch(stream, 0);
                truearm_correct(null(), null_mut(), null(), 0, null(), 0, to, JOINTS, null_mut());
            }
        }
        std::hint::black_box(rig.pose(&HOME));
        std::hint::black_box((truearm_status_text(-3), truearm_reason_text(4), truearm_version()));
    });
    assert_eq!(found, 0);
    // SAFETY: made above and not used afterwards.
    unsafe { truearm_stream_free(stream) };
}
