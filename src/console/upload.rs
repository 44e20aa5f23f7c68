//! Recordings that viewers send.

use axum::body::{Body, Bytes, HttpBody};
use axum::http::StatusCode;
use phasmid_core::new_file;
use std::future::poll_fn;
use std::io::Write;
use std::path::Path;
use std::pin::Pin;
use tokio::sync::mpsc;

/// Maximum size of a recording in bytes.
const MAX_BYTES: u64 = 8 << 30;
/// Maximum length of a name.
const MAX_NAME: usize = 100;
/// Ending of the names of recordings.
const ENDING: &str = ".rec";
/// Maximum number of parts of an upload that wait to be written to the file.
const MAX_WAITING: usize = 16;

/// Why an upload failed, for the viewer.
pub(crate) type Refusal = (StatusCode, String);

/// Checks that an upload is named like a recording and cannot leave the folder.
fn check(name: &str) -> Result<(), Refusal> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_. ".contains(c);
    let stem = name.strip_suffix(ENDING).unwrap_or_default();
    if !stem.is_empty()
        && !stem.starts_with('.')
        && name.len() <= MAX_NAME
        && stem.chars().all(plain)
    {
        return Ok(());
    }
    let why = format!(
        "{name:?}; expected a name that ends with {ENDING}, of up to {MAX_NAME} letters, digits, \
         spaces, -, _ and .\n"
    );
    Err((StatusCode::BAD_REQUEST, why))
}

/// Writes the body of a request to a new file. An incomplete file is not kept.
pub(crate) async fn store(folder: &Path, name: &str, mut body: Body) -> Result<(), Refusal> {
    check(name)?;
    let path = folder.join(name);
    if path.symlink_metadata().is_ok() {
        let why = format!("{name} exists; expected another name\n");
        return Err((StatusCode::CONFLICT, why));
    }
    let (put, mut parts) = mpsc::channel::<Option<Bytes>>(MAX_WAITING);
    let writer = tokio::task::spawn_blocking(move || {
        new_file::write(&path, false, |file| {
            loop {
                match parts.blocking_recv() {
                    Some(Some(part)) => file.write_all(&part)?,
                    Some(None) => return Ok(()),
                    None => return Err(std::io::Error::other("only a part was received")),
                }
            }
        })
    });
    let mut bytes = 0;
    loop {
        let data = match poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await {
            None => {
                let _ = put.send(None).await;
                break;
            }
            Some(Ok(frame)) => frame.into_data().unwrap_or_default(),
            Some(Err(_)) => break,
        };
        bytes += data.len() as u64;
        // The writer ends early only if it has failed.
        if bytes > MAX_BYTES || put.send(Some(data)).await.is_err() {
            break;
        }
    }
    drop(put);
    let written = writer.await;
    if bytes > MAX_BYTES {
        let why = format!("more than {} GiB; expected less\n", MAX_BYTES >> 30);
        return Err((StatusCode::PAYLOAD_TOO_LARGE, why));
    }
    let why = match written {
        Ok(Ok(())) => return Ok(()),
        Ok(Err(why)) => format!("{why}\n"),
        Err(_) => "the file could not be written\n".to_owned(),
    };
    Err((StatusCode::INTERNAL_SERVER_ERROR, why))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_in_the_folder() {
        for good in ["day.rec", "a b-c_1.2.rec"] {
            assert_eq!(check(good), Ok(()));
        }
        for bad in [
            "day.txt",
            ".rec",
            "..rec",
            "../day.rec",
            "a/b.rec",
            "a\\b.rec",
            "a\0.rec",
            &format!("{}.rec", "a".repeat(100)),
        ] {
            assert_eq!(check(bad).unwrap_err().0, StatusCode::BAD_REQUEST, "{bad}");
        }
    }
}
