//! The grey image: received camera frames are stored in this type, and the decoder reads it. A view
//! borrows an image, or samples that another program owns.

use phasmid_core::error::{Error, Result};

/// Grey levels in digital numbers (DN), row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Samples {
    /// 8-bit samples.
    U8(Vec<u8>),
    /// 9- to 16-bit samples, in the low bits.
    U16(Vec<u16>),
}

impl Samples {
    /// Returns the number of samples.
    #[inline]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(samples) => samples.len(),
            Self::U16(samples) => samples.len(),
        }
    }

    /// Returns whether there are no samples.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl From<Vec<u8>> for Samples {
    fn from(samples: Vec<u8>) -> Self {
        Self::U8(samples)
    }
}

impl From<Vec<u16>> for Samples {
    fn from(samples: Vec<u16>) -> Self {
        Self::U16(samples)
    }
}

/// A grey image of 8 or 16 bits per sample, without padding between rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    samples: Samples,
}

impl Default for Image {
    /// Returns an image without pixels. It stands for a frame that was not loaded.
    fn default() -> Self {
        Self {
            width: 0,
            height: 0,
            samples: Samples::U8(Vec::new()),
        }
    }
}

impl Image {
    /// Creates an image of `width` columns and `height` rows from its samples, row by row.
    ///
    /// # Errors
    /// Returns an error if the number of samples is not `width * height`.
    pub fn new(width: usize, height: usize, samples: impl Into<Samples>) -> Result<Self> {
        let samples = samples.into();
        check_size(width, height, samples.len())?;
        Ok(Self {
            width,
            height,
            samples,
        })
    }

    /// Returns the number of columns.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the samples, row by row.
    #[inline]
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Returns the samples, row by row, without copying them.
    pub fn into_samples(self) -> Samples {
        self.samples
    }

    /// Returns the samples of an 8-bit image, row by row.
    #[inline]
    pub fn as_u8(&self) -> Option<&[u8]> {
        match &self.samples {
            Samples::U8(samples) => Some(samples),
            Samples::U16(_) => None,
        }
    }

    /// Returns the samples of a 16-bit image, row by row.
    #[inline]
    pub fn as_u16(&self) -> Option<&[u16]> {
        match &self.samples {
            Samples::U16(samples) => Some(samples),
            Samples::U8(_) => None,
        }
    }

    /// Returns the samples of an 8-bit image, row by row, for modification.
    #[inline]
    pub fn as_u8_mut(&mut self) -> Option<&mut [u8]> {
        match &mut self.samples {
            Samples::U8(samples) => Some(samples),
            Samples::U16(_) => None,
        }
    }

    /// Returns the samples of a 16-bit image, row by row, for modification.
    #[inline]
    pub fn as_u16_mut(&mut self) -> Option<&mut [u16]> {
        match &mut self.samples {
            Samples::U16(samples) => Some(samples),
            Samples::U8(_) => None,
        }
    }

    /// Returns whether the image has no pixels, like the image of a frame that was not loaded.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Returns the number of bits per sample: 8 or 16.
    #[inline]
    pub fn bits(&self) -> u32 {
        self.view().bits()
    }

    /// Returns the largest value of the sample type: 255 or 65535.
    #[inline]
    pub fn full_scale(&self) -> u16 {
        self.view().full_scale()
    }

    /// Returns a sample in DN; `index` counts row by row.
    ///
    /// # Panics
    /// Panics if the image has no such sample.
    #[inline]
    pub fn value(&self, index: usize) -> u16 {
        self.view().value(index)
    }

    /// Borrows the image.
    #[inline]
    pub fn view(&self) -> ImageView<'_> {
        ImageView {
            width: self.width,
            height: self.height,
            samples: match &self.samples {
                Samples::U8(samples) => SamplesView::U8(samples),
                Samples::U16(samples) => SamplesView::U16(samples),
            },
        }
    }

    /// Returns the image of every `every`-th pixel of every `every`-th row, the first of each
    /// included.
    #[must_use]
    pub fn thinned(&self, every: usize) -> Self {
        fn of<T: Copy>(samples: &[T], width: usize, every: usize) -> Vec<T> {
            let mut kept = Vec::with_capacity(samples.len() / (every * every) + width);
            for row in samples.chunks_exact(width.max(1)).step_by(every) {
                kept.extend(row.chunks(every).map(|pixels| pixels[0]));
            }
            kept
        }
        let every = every.max(1);
        Self {
            width: self.width.div_ceil(every),
            height: self.height.div_ceil(every),
            samples: match &self.samples {
                Samples::U8(samples) => of(samples, self.width, every).into(),
                Samples::U16(samples) => of(samples, self.width, every).into(),
            },
        }
    }

    /// Returns the image of every `every`-th column, the first included.
    #[must_use]
    pub fn columns(&self, every: usize) -> Self {
        fn of<T: Copy>(samples: &[T], width: usize, every: usize) -> Vec<T> {
            let mut kept = Vec::with_capacity(samples.len() / every + samples.len() / width.max(1));
            for row in samples.chunks_exact(width.max(1)) {
                kept.extend(row.iter().step_by(every));
            }
            kept
        }
        let every = every.max(1);
        Self {
            width: self.width.div_ceil(every),
            height: self.height,
            samples: match &self.samples {
                Samples::U8(samples) => of(samples, self.width, every).into(),
                Samples::U16(samples) => of(samples, self.width, every).into(),
            },
        }
    }

    /// Returns the columns and rows that all `images` have. Images without pixels are left out.
    ///
    /// # Errors
    /// Returns an error if no image has pixels, or if two differ in size or in bits per sample.
    pub fn common_size(images: &[Self]) -> Result<[usize; 2]> {
        ImageView::common_size(images.iter().map(Self::view))
    }
}

/// Borrowed samples of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SamplesView<'a> {
    /// 8-bit samples.
    U8(&'a [u8]),
    /// 9- to 16-bit samples, in the low bits.
    U16(&'a [u16]),
}

impl<'a> From<&'a [u8]> for SamplesView<'a> {
    fn from(samples: &'a [u8]) -> Self {
        Self::U8(samples)
    }
}

impl<'a> From<&'a [u16]> for SamplesView<'a> {
    fn from(samples: &'a [u16]) -> Self {
        Self::U16(samples)
    }
}

/// A borrowed [`Image`], or borrowed samples in other memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageView<'a> {
    width: usize,
    height: usize,
    samples: SamplesView<'a>,
}

impl<'a> ImageView<'a> {
    /// Creates a view of `width` columns and `height` rows from samples, row by row.
    ///
    /// # Errors
    /// Returns an error if the number of samples is not `width * height`.
    pub fn new(width: usize, height: usize, samples: impl Into<SamplesView<'a>>) -> Result<Self> {
        let samples = samples.into();
        let view = Self {
            width,
            height,
            samples,
        };
        check_size(width, height, view.len())?;
        Ok(view)
    }

    /// Returns the number of columns.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the samples, row by row.
    #[inline]
    pub fn samples(&self) -> SamplesView<'a> {
        self.samples
    }

    fn len(&self) -> usize {
        match self.samples {
            SamplesView::U8(samples) => samples.len(),
            SamplesView::U16(samples) => samples.len(),
        }
    }

    /// Returns whether the image has no pixels, like the image of a frame that was not loaded.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of bits per sample: 8 or 16.
    #[inline]
    pub fn bits(&self) -> u32 {
        match self.samples {
            SamplesView::U8(_) => 8,
            SamplesView::U16(_) => 16,
        }
    }

    /// Returns the largest value of the sample type: 255 or 65535.
    #[inline]
    pub fn full_scale(&self) -> u16 {
        match self.samples {
            SamplesView::U8(_) => u16::from(u8::MAX),
            SamplesView::U16(_) => u16::MAX,
        }
    }

    /// Returns a sample in DN; `index` counts row by row.
    ///
    /// # Panics
    /// Panics if the image has no such sample.
    #[inline]
    pub fn value(&self, index: usize) -> u16 {
        match self.samples {
            SamplesView::U8(samples) => u16::from(samples[index]),
            SamplesView::U16(samples) => samples[index],
        }
    }

    /// Returns the columns and rows that all images have. Images without pixels are left out.
    ///
    /// # Errors
    /// Returns an error if no image has pixels, or if two differ in size or in bits per sample.
    pub fn common_size(images: impl IntoIterator<Item = Self>) -> Result<[usize; 2]> {
        let images = images.into_iter().enumerate();
        let mut loaded = images.filter(|(_, image)| !image.is_empty());
        let Some((_, first)) = loaded.next() else {
            return Err(Error::input("frames", "none", "at least one frame"));
        };
        for (i, image) in loaded {
            let of = |image: Self| {
                let bits = image.bits();
                format!("{} x {} pixels of {bits} bits", image.width, image.height)
            };
            let kind = |image: Self| (image.width, image.height, image.bits());
            if kind(image) != kind(first) {
                let expected = format!("{}, like the frames before it", of(first));
                return Err(Error::input(format!("frame {i}"), of(image), expected));
            }
        }
        Ok([first.width, first.height])
    }
}

/// Checks the number of samples.
fn check_size(width: usize, height: usize, samples: usize) -> Result<()> {
    if width.checked_mul(height) != Some(samples) {
        return Err(Error::input(
            "image",
            format!("{samples} samples"),
            format!("{width} x {height} samples"),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_of_samples_matches_the_size() {
        let image = Image::new(3, 2, vec![1_u16, 2, 3, 4, 5, 600]).unwrap();
        assert_eq!((image.bits(), image.full_scale()), (16, u16::MAX));
        assert_eq!((image.value(5), image.value(0)), (600, 1));
        let error = Image::new(3, 2, vec![0_u8; 5]).unwrap_err().to_string();
        assert_eq!(error, "image: 5 samples; expected 3 x 2 samples");
        assert!(Image::new(usize::MAX, 2, vec![0_u8; 5]).is_err());
        assert_eq!(
            ImageView::new(3, 2, image.as_u16().unwrap()).unwrap(),
            image.view()
        );
        assert!(ImageView::new(3, 3, image.as_u16().unwrap()).is_err());
    }

    #[test]
    fn thinning_keeps_the_first_pixel_of_each_group() {
        let image = Image::new(5, 3, (0..15).collect::<Vec<u8>>()).unwrap();
        let thin = image.thinned(2);
        assert_eq!((thin.width(), thin.height()), (3, 2));
        assert_eq!(thin.samples(), &Samples::U8(vec![0, 2, 4, 10, 12, 14]));
        assert_eq!(image.thinned(1), image);
    }

    #[test]
    fn common_size_names_the_first_image_that_differs() {
        let of = |width, height| Image::new(width, height, vec![0_u8; width * height]).unwrap();
        let images = [Image::default(), of(4, 3), Image::default(), of(4, 3)];
        assert_eq!(Image::common_size(&images).unwrap(), [4, 3]);
        let error = Image::common_size(&[of(4, 3), of(3, 4)]).unwrap_err();
        assert!(
            error.to_string().starts_with("frame 1: 3 x 4 pixels"),
            "{error}"
        );
        let deep = Image::new(4, 3, vec![0_u16; 12]).unwrap();
        let error = Image::common_size(&[of(4, 3), deep]).unwrap_err();
        assert!(error.to_string().contains("of 16 bits"), "{error}");
        assert!(Image::common_size(&[Image::default()]).is_err());
    }
}
