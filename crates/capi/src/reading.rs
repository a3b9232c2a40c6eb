//! Bytes of a calibration file, of which no more are read than can be one.

use std::ffi::CStr;
use std::fs::{File, FileType};
use std::io::Read;
use std::path::Path;

use crate::container::{FIRST_BYTES, check_first};
use crate::load_error::LoadError;

/// The bytes of a file, if its first ones are those of a safetensors file.
///
/// What it is is looked up before it is opened: opening a pipe waits for its other end.
///
/// # Errors
/// [`LoadError::Unreadable`], [`LoadError::NoFile`], and those of [`check_first`].
pub fn read(name: &CStr) -> Result<Vec<u8>, LoadError> {
    #[cfg(unix)]
    let path: &Path = <std::ffi::OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(name.to_bytes()).as_ref();
    #[cfg(not(unix))]
    let path = Path::new(name.to_str().map_err(|_| std::io::Error::from(std::io::ErrorKind::InvalidInput))?);
    let kind = std::fs::metadata(path)?.file_type();
    if !kind.is_file() {
        return Err(LoadError::NoFile(words(kind)));
    }
    let mut file = File::open(path)?;
    let size = file.metadata()?.len();
    let mut bytes = Vec::new();
    file.by_ref().take(FIRST_BYTES as u64).read_to_end(&mut bytes)?;
    check_first(&bytes, size)?;
    file.take(size - bytes.len() as u64).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn words(kind: FileType) -> &'static str {
    if kind.is_dir() { "a directory" } else { "a pipe or a device" }
}
