//! The sample types that the row kernels are compiled for.

use phasmid_pattern::{ImageView, SamplesView};

/// A sample type that the row kernels are compiled for.
pub(super) trait Sample: Copy + Send + Sync + 'static {
    /// The sample as a number.
    fn dn(self) -> f32;
    /// The image's samples if it holds this type.
    fn slice(image: ImageView<'_>) -> Option<&[Self]>;
}

/// The samples of each image; empty for an image of another sample type, and for a frame that was not
/// loaded.
pub(super) fn typed<'a, T: Sample>(images: &[ImageView<'a>]) -> Vec<&'a [T]> {
    let samples = images.iter().map(|image| T::slice(*image));
    samples.map(Option::unwrap_or_default).collect()
}

impl Sample for u8 {
    #[inline(always)]
    fn dn(self) -> f32 {
        f32::from(self)
    }
    fn slice(image: ImageView<'_>) -> Option<&[Self]> {
        match image.samples() {
            SamplesView::U8(samples) => Some(samples),
            SamplesView::U16(_) => None,
        }
    }
}

impl Sample for u16 {
    #[inline(always)]
    fn dn(self) -> f32 {
        f32::from(self)
    }
    fn slice(image: ImageView<'_>) -> Option<&[Self]> {
        match image.samples() {
            SamplesView::U16(samples) => Some(samples),
            SamplesView::U8(_) => None,
        }
    }
}
