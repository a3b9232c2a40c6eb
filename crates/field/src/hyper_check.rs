//! What hyper-parameters of an arm may be: a file may say anything.

use truearm_bank::{Input, MOST_AXES};

use crate::FieldError;
use crate::hyper::Hyper;

/// Beyond, a file holds no hyper-parameters of an arm.
const MOST_WAVES: usize = 100;
const MOST_CYCLES: f64 = 1e4;
const LONGEST_SCALE: f64 = 1e3;

impl Hyper {
    /// Checks what a file may say of an arm of so many joints, and so many drives that turn several of them: joints that there
    /// are, and waves that some drive may leave.
    ///
    /// # Errors
    /// [`FieldError::Hyper`].
    pub fn check(&self, inputs: &[Input], joints: usize, drives: usize) -> Result<(), FieldError> {
        let refuse = |what| Err(FieldError::Hyper { what });
        self.check_numbers()?;
        if self.products.iter().any(|product| product.joints.len() > MOST_AXES) {
            return refuse("a block varies with more than three joints");
        }
        if self.products.iter().any(|product| product.joints.len() != product.lengths.len()) {
            return refuse("a block has not one length scale for each of its joints");
        }
        if self.products.iter().flat_map(|product| &product.joints).any(|&joint| joint >= inputs.len()) {
            return refuse("a block varies with a joint that the arm has not");
        }
        let lengths = self.products.iter().flat_map(|product| &product.lengths);
        let scales = lengths.chain(&self.constant).chain([
            &self.own_length,
            &self.smooth_length,
            &self.smooth_line_length,
        ]);
        if !scales.into_iter().all(|scale| *scale > 0.0 && scale.is_finite()) {
            return refuse("a length scale or a factor is not positive");
        }
        let lengths = self.products.iter().flat_map(|product| &product.lengths);
        if lengths.chain([&self.own_length, &self.smooth_length, &self.smooth_line_length]).any(is_too_long) {
            return refuse("a length scale is a thousand times what an arm has");
        }
        if !(0.0..=MOST_CYCLES).contains(&self.own_cycles) {
            return refuse("curves of joints ripple as no drive does");
        }
        if self.waves.len() > MOST_WAVES {
            return refuse("there are more waves than an arm has drives");
        }
        if self.by_readings && drives == 0 {
            return refuse("curves go with readings of an arm whose joints are not coupled");
        }
        let readings = inputs.len()..inputs.len() + if self.by_readings { drives } else { 0 };
        for wave in &self.waves {
            if wave.joint >= joints && !readings.contains(&wave.joint) {
                return refuse("a wave is of a joint that the arm has not");
            }
            let of_drives = wave.cycles > 0.0 && wave.cycles <= MOST_CYCLES;
            let is_there = wave.amplitude > 0.0 && wave.amplitude.is_finite();
            if !(of_drives && is_there) {
                return refuse("a wave has no cycles of any drive, or no amplitude");
            }
        }
        Ok(())
    }

    /// Checks amplitudes, noise and factors, whatever the arm.
    fn check_numbers(&self) -> Result<(), FieldError> {
        let refuse = |what| Err(FieldError::Hyper { what });
        let products = self.products.iter().flat_map(|product| &product.amplitudes);
        let amplitudes = products.chain(&self.smooth).chain(&self.unevenness);
        let amplitudes = amplitudes.chain([&self.own, &self.repeatability, &self.sag]);
        if !amplitudes.into_iter().all(|amplitude| *amplitude >= 0.0 && amplitude.is_finite()) {
            return refuse("an amplitude is negative or no number");
        }
        if !self.noise.iter().all(|noise| *noise > 0.0 && noise.is_finite()) {
            return refuse("a noise is not positive");
        }
        let products = self.products.iter().flat_map(|product| &product.widening);
        let factors = products.chain(&self.smooth_widening).chain([
            &self.own_widening,
            &self.sag_widening,
            &self.extrapolation,
        ]);
        if !factors.into_iter().all(|factor| *factor > 0.0 && factor.is_finite()) {
            return refuse("a widening or the factor beyond the measurements is not positive");
        }
        Ok(())
    }
}

fn is_too_long(scale: &f64) -> bool {
    *scale > LONGEST_SCALE
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::*;
    use crate::hyper::{MAJOR_NAME, Product, Wave};

    #[test]
    fn hyper_parameters_of_no_arm_are_refused() {
        let inputs = [Input::ANGLE; 6];
        let good = Hyper::start(&[1, 2], 6, [1e-4, 1e-4]);
        let waved = |joint, cycles, amplitude| {
            Hyper { waves: vec![Wave { joint, cycles, amplitude }], ..good.clone() }.check(&inputs, 6, 0)
        };
        assert!(good.check(&inputs, 6, 0).is_ok());
        assert!(waved(5, 202.0, 1e-4).is_ok());
        for (joint, cycles, amplitude) in [
            (6, 202.0, 1e-4),
            (1, 0.0, 1e-4),
            (1, -3.0, 1e-4),
            (1, 1e17, 1e-4),
            (1, f64::NAN, 1e-4),
            (1, 202.0, 0.0),
            (1, 202.0, f64::INFINITY),
        ] {
            assert!(waved(joint, cycles, amplitude).is_err(), "{joint} {cycles} {amplitude}");
        }
        for own_cycles in [-1.0, 1e17, f64::NAN] {
            assert!(Hyper { own_cycles, ..good.clone() }.check(&inputs, 6, 0).is_err(), "{own_cycles}");
        }
        for wrong in [1e13, 1e300] {
            let own = Hyper { own_length: wrong, ..good.clone() };
            let line = Hyper { smooth_line_length: wrong, ..good.clone() };
            assert!(own.check(&inputs, 6, 0).is_err() && line.check(&inputs, 6, 0).is_err(), "{wrong}");
        }
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let constant = [1.0, wrong, 1.0];
            assert!(
                Hyper { own_length: wrong, ..good.clone() }.check(&inputs, 6, 0).is_err(),
                "length {wrong}"
            );
            assert!(Hyper { constant, ..good.clone() }.check(&inputs, 6, 0).is_err(), "factor {wrong}");
        }
        let with = |spoil: &dyn Fn(&mut Hyper)| {
            let mut spoilt = good.clone();
            spoil(&mut spoilt);
            spoilt.check(&inputs, 6, 0)
        };
        assert!(with(&|hyper| hyper.products[0] = Product::start(MAJOR_NAME, vec![0, 1, 2, 3])).is_err());
        assert!(with(&|hyper| hyper.products[0].lengths.truncate(1)).is_err());
        assert!(with(&|hyper| hyper.sag = 0.0).is_ok());
        assert!(with(&|hyper| hyper.noise[1] = 0.0).is_err());
        for wrong in [-1e-4, f64::NAN, f64::INFINITY] {
            assert!(with(&|hyper| hyper.own = wrong).is_err(), "own {wrong}");
            assert!(with(&|hyper| hyper.smooth[2] = wrong).is_err(), "smooth {wrong}");
            assert!(with(&|hyper| hyper.repeatability = wrong).is_err(), "repeatability {wrong}");
            assert!(with(&|hyper| hyper.products[1].amplitudes[0] = wrong).is_err(), "amplitude {wrong}");
            assert!(with(&|hyper| hyper.products[1].widening[0] = wrong).is_err(), "widening {wrong}");
            assert!(with(&|hyper| hyper.noise[0] = wrong).is_err(), "noise {wrong}");
            assert!(with(&|hyper| hyper.extrapolation = wrong).is_err(), "extrapolation {wrong}");
        }
        let elsewhere = Hyper::start(&[1, 9], 6, [1e-4, 1e-4]);
        assert!(elsewhere.check(&inputs, 6, 0).unwrap_err().to_string().contains("calibrate again"));
        let many = vec![Wave { joint: 1, cycles: 100.0, amplitude: 1e-4 }; MOST_WAVES + 1];
        assert!(Hyper { waves: many, ..good }.check(&inputs, 6, 0).is_err());
    }
}
