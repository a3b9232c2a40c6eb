//! Hyper-parameters of a field as Python keeps them: lists of numbers by name.

use std::collections::{BTreeMap, HashMap};

use pyo3::prelude::*;
use truearm_bank::UPRIGHT;
use truearm_field::{Hyper, MAJOR_NAME, Product, UNRIPPLED, WRIST_NAME, Wave};

use crate::door::CoreError;

/// Key of what curves of coupled joints go with; kept where it is not zero.
const BY_READINGS: &str = "by_readings";

/// Key of the joints' factors on what they do not repeat; files from before there were any have none.
const UNEVENNESS: &str = "unevenness";

/// From values by name.
pub fn hyper_from(values: &HashMap<String, Vec<f64>>) -> PyResult<Hyper> {
    let get = |name: &str| {
        let message = || CoreError::new_err(format!("hyper-parameter '{name}' is missing"));
        values.get(name).cloned().ok_or_else(message)
    };
    let one = |name: &str| {
        let found = get(name)?;
        let message = || CoreError::new_err(format!("hyper-parameter '{name}' has no value"));
        found.first().copied().ok_or_else(message)
    };
    let three = |name: &str| -> PyResult<[f64; 3]> {
        let found = get(name)?;
        let message = || CoreError::new_err(format!("hyper-parameter '{name}' needs 3 values"));
        found.try_into().map_err(|_| message())
    };
    let product = |name: &str| -> PyResult<Product> {
        Ok(Product {
            name: name.to_owned(),
            amplitudes: three(&format!("{name}_amplitudes"))?,
            joints: get(&format!("{name}_joints"))?.into_iter().map(joint_from).collect::<PyResult<_>>()?,
            lengths: get(&format!("{name}_lengths"))?,
            widening: three(&format!("{name}_widening"))?,
        })
    };
    let names = [MAJOR_NAME, WRIST_NAME];
    let present = names.iter().filter(|name| values.contains_key(&format!("{name}_joints")));
    Ok(Hyper {
        constant: match get("constant")?.as_slice() {
            &[shared] => [shared; 3],
            _ => three("constant")?,
        },
        own: one("own")?,
        own_length: one("own_length")?,
        own_cycles: values.get("own_cycles").map_or(Ok(UNRIPPLED), |_| one("own_cycles"))?,
        smooth: three("smooth")?,
        smooth_length: one("smooth_length")?,
        smooth_line_length: values
            .get("smooth_line_length")
            .map_or_else(|| one("smooth_length"), |_| one("smooth_line_length"))?,
        repeatability: one("repeatability")?,
        unevenness: values.get(UNEVENNESS).cloned().unwrap_or_default(),
        products: present.map(|name| product(name)).collect::<PyResult<_>>()?,
        waves: values.get("waves").map_or_else(|| Ok(Vec::new()), |stored| waves_from(stored))?,
        noise: [one("noise_position")?, one("noise_orientation")?],
        own_widening: one("own_widening")?,
        smooth_widening: three("smooth_widening")?,
        sag: values.get("sag").map_or(Ok(0.0), |_| one("sag"))?,
        up: values.get("up").map_or(Ok(UPRIGHT), |_| three("up"))?,
        sag_widening: values.get("sag_widening").map_or(Ok(1.0), |_| one("sag_widening"))?,
        extrapolation: one("extrapolation")?,
        by_readings: values.get(BY_READINGS).map_or(Ok(0.0), |_| one(BY_READINGS))? != 0.0,
    })
}

/// Of each wave its joint, its phase by the joint's value and its amplitude.
fn waves_from(stored: &[f64]) -> PyResult<Vec<Wave>> {
    let (waves, left) = stored.as_chunks();
    if !left.is_empty() {
        return Err(CoreError::new_err("hyper-parameter 'waves' needs three values a wave; calibrate again"));
    }
    let wave =
        |&[joint, cycles, amplitude]: &[f64; 3]| Ok(Wave { joint: joint_from(joint)?, cycles, amplitude });
    waves.iter().map(wave).collect()
}

fn joint_from(stored: f64) -> PyResult<usize> {
    if stored < 0.0 || stored.fract() != 0.0 || !stored.is_finite() {
        let text =
            format!("hyper-parameters name joint {stored}: joints are counted from 0; calibrate again");
        return Err(CoreError::new_err(text));
    }
    Ok(stored as usize)
}

/// To values by name, in the order of their names.
pub fn hyper_into(hyper: &Hyper) -> BTreeMap<String, Vec<f64>> {
    let mut values = BTreeMap::from([
        ("constant".to_owned(), hyper.constant.to_vec()),
        ("own".to_owned(), vec![hyper.own]),
        ("own_length".to_owned(), vec![hyper.own_length]),
        ("own_cycles".to_owned(), vec![hyper.own_cycles]),
        ("smooth".to_owned(), hyper.smooth.to_vec()),
        ("smooth_length".to_owned(), vec![hyper.smooth_length]),
        ("smooth_line_length".to_owned(), vec![hyper.smooth_line_length]),
        ("repeatability".to_owned(), vec![hyper.repeatability]),
        (UNEVENNESS.to_owned(), hyper.unevenness.clone()),
        ("noise_position".to_owned(), vec![hyper.noise[0]]),
        ("noise_orientation".to_owned(), vec![hyper.noise[1]]),
        ("own_widening".to_owned(), vec![hyper.own_widening]),
        ("smooth_widening".to_owned(), hyper.smooth_widening.to_vec()),
        ("sag".to_owned(), vec![hyper.sag]),
        ("sag_widening".to_owned(), vec![hyper.sag_widening]),
        ("up".to_owned(), hyper.up.to_vec()),
        ("extrapolation".to_owned(), vec![hyper.extrapolation]),
    ]);
    if hyper.by_readings {
        values.insert(BY_READINGS.to_owned(), vec![1.0]);
    }
    let waves = hyper.waves.iter().flat_map(|wave| [wave.joint as f64, wave.cycles, wave.amplitude]);
    values.insert("waves".to_owned(), waves.collect());
    for product in &hyper.products {
        let name = &product.name;
        let joints = product.joints.iter().map(|&joint| joint as f64).collect();
        values.insert(format!("{name}_amplitudes"), product.amplitudes.to_vec());
        values.insert(format!("{name}_joints"), joints);
        values.insert(format!("{name}_lengths"), product.lengths.clone());
        values.insert(format!("{name}_widening"), product.widening.to_vec());
    }
    values
}
