//! The container of a calibration: safetensors with arrays, one JSON text, and a digest over every byte.
//!
//! The digest is SHA-256 over the whole file with its own 64 digits as zeros; it stands in the JSON text, which is a
//! JSON string of the header, so that its quotes are escaped there.

use safetensors::{Dtype, SafeTensors};
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::load_error::LoadError;

const METADATA_KEY: &str = "truearm";
/// Bytes before the header: its length.
const LENGTH_BYTES: usize = 8;
/// Bytes that tell whether a file can be a safetensors file: the length of the header, and its first byte.
pub const FIRST_BYTES: usize = LENGTH_BYTES + 1;
/// Longest header of a safetensors file.
const LONGEST_HEADER: u64 = 100_000_000;
/// What stands before the digest's digits.
const DIGEST_KEY: &[u8] = br#"\"sha256\":\""#;
const DIGITS: usize = 64;

/// The arrays and the JSON text of a calibration whose every byte is as it was written.
pub struct Container<'a> {
    tensors: SafeTensors<'a>,
    text: String,
}

impl<'a> Container<'a> {
    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`LoadError::NotOurs`], [`LoadError::Altered`].
    pub fn new(bytes: &'a [u8]) -> Result<Self, LoadError> {
        let text = header_text(bytes)?;
        check_digest(bytes)?;
        let tensors =
            SafeTensors::deserialize(bytes).map_err(|error| LoadError::Altered(error.to_string()))?;
        Ok(Self { tensors, text })
    }

    /// The JSON values.
    ///
    /// # Errors
    /// [`LoadError::Content`].
    pub fn content<T: DeserializeOwned>(&self) -> Result<T, LoadError> {
        serde_json::from_str(&self.text).map_err(|error| LoadError::Content(error.to_string()))
    }

    /// The numbers of an array.
    ///
    /// # Errors
    /// [`LoadError::Content`].
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, LoadError> {
        let missing = |_| LoadError::Content(format!("it has no array \"{name}\""));
        let view = self.tensors.tensor(name).map_err(missing)?;
        if view.dtype() != Dtype::F64 {
            return Err(LoadError::Content(format!("the array \"{name}\" holds no 64-bit numbers")));
        }
        let (words, _) = view.data().as_chunks::<8>();
        Ok(words.iter().map(|word| f64::from_le_bytes(*word)).collect())
    }
}

/// Whether a file of `size` bytes, of which `first` are the first [`FIRST_BYTES`], can be a safetensors file.
///
/// # Errors
/// [`LoadError::NotOurs`], [`LoadError::Altered`].
pub fn check_first(first: &[u8], size: u64) -> Result<(), LoadError> {
    if size == 0 {
        return Err(LoadError::NotOurs("it is empty"));
    }
    let length = first.first_chunk::<LENGTH_BYTES>().map(|bytes| u64::from_le_bytes(*bytes));
    let begins = first.get(LENGTH_BYTES) == Some(&b'{');
    let Some(length) = length.filter(|length| begins && *length <= LONGEST_HEADER) else {
        return Err(LoadError::NotOurs("no safetensors file"));
    };
    let needed = LENGTH_BYTES as u64 + length;
    if size < needed {
        return Err(LoadError::Altered(format!("it has {size} bytes, its header alone needs {needed}")));
    }
    Ok(())
}

fn header_text(bytes: &[u8]) -> Result<String, LoadError> {
    check_first(bytes, bytes.len() as u64)?;
    let (_, header) =
        SafeTensors::read_metadata(bytes).map_err(|error| LoadError::Altered(error.to_string()))?;
    let text = header.metadata().as_ref().and_then(|metadata| metadata.get(METADATA_KEY));
    text.cloned().ok_or(LoadError::NotOurs("a safetensors file of something else"))
}

fn check_digest(bytes: &[u8]) -> Result<(), LoadError> {
    let altered = |what: &str| LoadError::Altered(what.to_owned());
    let place = bytes.windows(DIGEST_KEY.len()).position(|window| window == DIGEST_KEY);
    let first = place.ok_or_else(|| altered("it holds no digest"))? + DIGEST_KEY.len();
    let stated = bytes.get(first..first + DIGITS).ok_or_else(|| altered("its digest is cut short"))?;
    let mut hasher = Sha256::new();
    hasher.update(&bytes[..first]);
    hasher.update([b'0'; DIGITS]);
    hasher.update(&bytes[first + DIGITS..]);
    let digits = |byte: &u8| [byte >> 4, byte & 15].map(|half| b"0123456789abcdef"[usize::from(half)]);
    if hasher.finalize().iter().flat_map(digits).eq(stated.iter().copied()) {
        Ok(())
    } else {
        Err(altered("its content does not agree with its SHA-256 digest"))
    }
}
