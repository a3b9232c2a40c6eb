//! Repeatable random numbers (SplitMix64; Steele, Lea and Flood 2014).

pub struct Random(u64);

impl Random {
    /// A stream of its own for every seed: states are mixed, since those of near seeds would only be shifted.
    pub fn new(seed: u64) -> Self {
        Self(mixed(mixed(seed ^ 0xD1B5_4A32_D192_ED03)))
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        (mixed(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Standard normal (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    pub fn normals<const N: usize>(&mut self, sigma: f64) -> [f64; N] {
        std::array::from_fn(|_| sigma * self.normal())
    }
}

fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
