//! Borrowed frames: a stack of images of equal size and sample type.

use phasmid_core::error::{Error, Result};

/// One frame's samples in digital numbers, row by row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Samples<'a> {
    /// 8-bit samples.
    U8(&'a [u8]),
    /// 9- to 16-bit samples, in the low bits.
    U16(&'a [u16]),
}

impl Samples<'_> {
    /// Returns the number of samples.
    #[inline]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(s) => s.len(),
            Self::U16(s) => s.len(),
        }
    }

    /// Returns whether there are no samples, as in a frame that was not loaded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether two frames hold the same type of sample.
    fn same_depth(&self, other: &Self) -> bool {
        matches!(
            (self, other),
            (Self::U8(_), Self::U8(_)) | (Self::U16(_), Self::U16(_))
        )
    }
}

/// The frames of a sequence in the manifest's order.
#[derive(Debug, Clone)]
pub struct FrameStack<'a> {
    width: usize,
    height: usize,
    frames: Vec<Samples<'a>>,
}

impl<'a> FrameStack<'a> {
    /// Creates a stack of frames of `width` x `height` samples each; a frame that no decoder needs
    /// (an image pattern) may be empty.
    ///
    /// # Errors
    /// Returns an error if there is no frame, if a frame has another size, or if sample types differ.
    pub fn new(width: usize, height: usize, frames: Vec<Samples<'a>>) -> Result<Self> {
        let Some(first) = frames.first() else {
            return Err(Error::input("frames", "none", "at least one frame"));
        };
        for (i, frame) in frames.iter().enumerate() {
            if !frame.is_empty() && frame.len() != width * height {
                return Err(Error::input(
                    format!("frame {i}"),
                    format!("{} samples", frame.len()),
                    format!("{width} x {height} = {} samples", width * height),
                ));
            }
            if !frame.same_depth(first) {
                return Err(Error::input(
                    format!("frame {i}"),
                    "another sample type than frame 0's",
                    "8-bit frames only, or 16-bit frames only",
                ));
            }
        }
        Ok(Self {
            width,
            height,
            frames,
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

    /// Returns the frames in order.
    #[inline]
    pub fn frames(&self) -> &[Samples<'a>] {
        &self.frames
    }

    /// Returns the largest value of the sample type.
    #[inline]
    pub fn full_scale(&self) -> f32 {
        match self.frames[0] {
            Samples::U8(_) => 255.0,
            Samples::U16(_) => 65535.0,
        }
    }

    /// The frames as slices of type `T`, if they have that type.
    pub(super) fn typed<T: Sample>(&self) -> Option<Vec<&'a [T]>> {
        self.frames.iter().map(|f| T::slice(*f)).collect()
    }
}

/// A sample type that the row kernels are compiled for.
pub(super) trait Sample: Copy + Send + Sync + 'static {
    /// The sample as a number.
    fn dn(self) -> f32;
    /// The frame's slice if it holds this type.
    fn slice(samples: Samples<'_>) -> Option<&[Self]>;
}

impl Sample for u8 {
    #[inline(always)]
    fn dn(self) -> f32 {
        f32::from(self)
    }
    fn slice(samples: Samples<'_>) -> Option<&[Self]> {
        match samples {
            Samples::U8(s) => Some(s),
            Samples::U16(_) => None,
        }
    }
}

impl Sample for u16 {
    #[inline(always)]
    fn dn(self) -> f32 {
        f32::from(self)
    }
    fn slice(samples: Samples<'_>) -> Option<&[Self]> {
        match samples {
            Samples::U16(s) => Some(s),
            Samples::U8(_) => None,
        }
    }
}
