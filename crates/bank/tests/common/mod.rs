//! What the tests share: random numbers, and arms whose true parameters vary in a known way.
#![allow(
    dead_code,
    missing_docs,
    unused_imports,
    clippy::unwrap_used,
    reason = "each test binary uses a part of it"
)]

mod arms;
mod random;

pub use arms::{Arm, Truth, scara, seven_axes, six_axes};
pub use random::Random;

/// Runs in a pool of its own.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}
