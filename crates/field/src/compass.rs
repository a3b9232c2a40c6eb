//! A search for the maximum of a function of two logarithms, where a derivative would cost more than it saves.

/// Where a search starts, its first and last step, and the ends that it does not pass.
pub struct Compass {
    pub start: [f64; 2],
    pub steps: (f64, f64),
    pub ends: (f64, f64),
}

impl Compass {
    /// Steps along both axes as long as one leads up, then halves the step (Hooke and Jeeves 1961, without patterns).
    ///
    /// `value` gives what is to be made largest first; `None` where it has no value. `None` if the start has none.
    ///
    /// # Errors
    /// Those of `value`.
    pub fn search<E>(
        &self,
        mut value: impl FnMut([f64; 2]) -> Result<Option<(f64, f64)>, E>,
    ) -> Result<Option<([f64; 2], f64, f64)>, E> {
        let Some((mut best, mut aside)) = value(self.start)? else { return Ok(None) };
        let (mut at, mut step) = (self.start, self.steps.0);
        while step >= self.steps.1 {
            let mut moved = false;
            for (which, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
                let mut trial = at;
                trial[which] = f64::clamp(trial[which] + sign * step, self.ends.0, self.ends.1);
                let found = if trial == at { None } else { value(trial)? };
                if let Some((higher, its)) = found
                    && higher > best
                {
                    (at, best, aside, moved) = (trial, higher, its, true);
                }
            }
            if !moved {
                step *= 0.5;
            }
        }
        Ok(Some((at, best, aside)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_top_and_respects_the_ends() {
        let compass = Compass { start: [0.0, 0.0], steps: (2.0, 1e-3), ends: (-5.0, 2.0) };
        let hill = |[x, y]: [f64; 2]| Ok::<_, ()>(Some((-(x - 1.3).powi(2) - (y - 4.0).powi(2), x + y)));
        let (at, _, aside) = compass.search(hill).unwrap().unwrap();
        assert!((at[0] - 1.3).abs() < 2e-3 && at[1] == 2.0, "{at:?}");
        assert!((aside - (at[0] + at[1])).abs() < 1e-15);
    }
}
