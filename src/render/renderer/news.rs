//! Opens the GPU of a renderer, and keeps notes for the user about the GPU and the scene.

use crate::Backend;
use crate::gpu::{Gpu, Passes};
use phasmid_core::error::{Error, Result};
use std::sync::Arc;

/// Status of the requested GPU, and notes about the scene.
#[derive(Default)]
pub(super) struct News {
    /// Notice that has not been reported yet.
    pub(super) text: Option<String>,
    /// Reason for the failure of an explicitly requested GPU.
    pub(super) failed: Option<String>,
}

impl News {
    /// Appends notes to the notice.
    pub(super) fn add(&mut self, notes: &[String]) {
        let all: Vec<String> = self
            .text
            .take()
            .into_iter()
            .chain(notes.iter().cloned())
            .collect();
        self.text = (!all.is_empty()).then(|| all.join("; "));
    }
}

/// Opens the GPU for a backend, or returns why the CPU is used in its place.
///
/// # Errors
/// Returns an error if a GPU was explicitly requested and there is no GPU.
pub(super) fn open(
    backend: Backend,
    fits: impl Fn() -> Result<(), String>,
    (pixels, samples): (u64, u64),
) -> Result<(Option<Box<Passes>>, News)> {
    let whole = |gpu: Arc<Gpu>| gpu.holds(pixels, samples).map(|()| gpu);
    let opened = match backend {
        Backend::Cpu => return Ok((None, News::default())),
        Backend::Gpu => fits()
            .map_err(|why| Error::input("--backend gpu", why, "--backend cpu for this scene"))
            .and_then(|()| Gpu::open(true))
            .and_then(whole),
        Backend::Auto => fits()
            .map_err(Error::device)
            .and_then(|()| Gpu::open(false))
            .and_then(whole),
    };
    match opened {
        Ok(gpu) => Ok((Some(Box::new(Passes::new(gpu))), News::default())),
        Err(e) if backend == Backend::Auto => {
            let text = Some(format!("rendering on the CPU: {e}"));
            Ok((None, News { text, failed: None }))
        }
        Err(e) => Err(e),
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;

    #[test]
    fn scene_beyond_f32_is_rendered_on_the_cpu() {
        let why = || Err("the scene reaches far".to_owned());
        let (gpu, mut news) = open(Backend::Auto, why, (1, 1)).unwrap();
        assert!(gpu.is_none());
        assert!(news.text.take().unwrap().contains("the scene reaches far"));
        let refused = open(Backend::Gpu, why, (1, 1)).err().unwrap();
        assert_eq!(refused.exit_code(), 2);
        assert!(refused.to_string().contains("the scene reaches far"));
    }
}
