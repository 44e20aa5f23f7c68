//! The sample types that the row kernels are compiled for.

use phasmid_pattern::Image;

/// A sample type that the row kernels are compiled for.
pub(super) trait Sample: Copy + Send + Sync + 'static {
    /// The sample as a number.
    fn dn(self) -> f32;
    /// The image's samples if it holds this type.
    fn slice(image: &Image) -> Option<&[Self]>;
}

/// The samples of each image; none of an image that holds another type, such as a frame that was
/// not loaded.
pub(super) fn typed<T: Sample>(images: &[Image]) -> Vec<&[T]> {
    let samples = images.iter().map(T::slice);
    samples.map(Option::unwrap_or_default).collect()
}

impl Sample for u8 {
    #[inline(always)]
    fn dn(self) -> f32 {
        f32::from(self)
    }
    fn slice(image: &Image) -> Option<&[Self]> {
        image.as_u8()
    }
}

impl Sample for u16 {
    #[inline(always)]
    fn dn(self) -> f32 {
        f32::from(self)
    }
    fn slice(image: &Image) -> Option<&[Self]> {
        image.as_u16()
    }
}
