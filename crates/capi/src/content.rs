//! The JSON values of a calibration that a controller needs.

use std::collections::HashMap;

use serde::Deserialize;
use truearm_bank::StoredAxis;

/// The part that every layout has.
#[derive(Deserialize)]
pub struct Head {
    pub schema: u64,
    #[serde(default)]
    pub version: String,
}

#[derive(Deserialize)]
pub struct Content {
    pub robot: RobotContent,
    pub options: OptionsContent,
    pub models: HashMap<String, ModelContent>,
    #[serde(default)]
    pub conservative: Option<ConservativeContent>,
    /// Set where the model is one of the paper's schemes.
    #[serde(default)]
    pub scheme: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
pub struct RobotContent {
    pub name: String,
    pub convention: String,
    pub joints: Vec<String>,
    pub table: Vec<[f64; 5]>,
    pub base: [[f64; 4]; 4],
    pub flange: [[f64; 4]; 4],
    pub tool: [[f64; 4]; 4],
    pub base_row: Option<[f64; 5]>,
    pub coupling: Vec<Vec<f64>>,
    pub limits: Vec<[Option<f64>; 2]>,
}

#[derive(Deserialize)]
pub struct OptionsContent {
    pub frame: String,
    pub features: Vec<String>,
}

#[derive(Deserialize)]
pub struct ModelContent {
    pub blocks: Option<Vec<BlockContent>>,
}

#[derive(Deserialize)]
pub struct BlockContent {
    pub name: String,
    pub inputs: Vec<usize>,
    pub axes: Vec<StoredAxis>,
    pub outputs: Vec<usize>,
    /// Which way is up in the base frame; the `sag` block says it where it is not the z axis.
    pub up: Option<[f64; 3]>,
    /// Factors of joint values whose sum is the reading that it is over, in place of a joint's value.
    pub reading: Option<Vec<f64>>,
}

#[derive(Deserialize)]
pub struct ConservativeContent {
    pub blocks: Vec<BlockContent>,
    pub level: [f64; 2],
    pub largest: [f64; 2],
    pub ranges: Vec<Option<[f64; 2]>>,
    pub looseness: [f64; 2],
    /// The flange's origin where a file does not say.
    #[serde(default)]
    pub centre: [f64; 3],
    /// Whether the file has the factor of a leverage.
    #[serde(default)]
    pub leverage: bool,
}
