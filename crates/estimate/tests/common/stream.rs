//! A small deterministic generator (SplitMix64; Steele, Lea and Flood 2014).

pub struct Stream(u64);

impl Stream {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xA076_1D64_78BD_642F) ^ 0x1234_5678)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Between -half and half.
    pub fn within(&mut self, half: f64) -> f64 {
        let unit = (self.bits() >> 11) as f64 / (1u64 << 53) as f64;
        half * (2.0 * unit - 1.0)
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (0.5 + self.within(0.5), self.within(std::f64::consts::PI));
        (-2.0 * u.max(f64::MIN_POSITIVE).ln()).sqrt() * v.cos()
    }

    pub fn vector(&mut self, half: f64) -> [f64; 3] {
        [self.within(half), self.within(half), self.within(half)]
    }

    pub fn normals(&mut self, sigma: f64) -> [f64; 3] {
        [sigma * self.normal(), sigma * self.normal(), sigma * self.normal()]
    }
}
