//! The vector types that callers may pass as points and directions.

use glam::{DVec2, DVec3};

/// A point or direction of the plane or an image: `[f64; 2]`.
pub trait Vector2: Copy {
    /// The 3D vector type of the same kind: `[f64; 3]`.
    type Space: Vector3<Image = Self>;
    #[doc(hidden)]
    fn to_glam(self) -> DVec2;
    #[doc(hidden)]
    fn from_glam(v: DVec2) -> Self;
}

/// A point or direction of space: `[f64; 3]`.
pub trait Vector3: Copy {
    /// The 2D vector type of the same kind: `[f64; 2]`.
    type Image: Vector2<Space = Self>;
    #[doc(hidden)]
    fn to_glam(self) -> DVec3;
    #[doc(hidden)]
    fn from_glam(v: DVec3) -> Self;
}

/// Implements both traits for a 2D and a 3D vector type.
macro_rules! vectors {
    ($(#[$hidden:meta])? $two:ty, $three:ty) => {
        $(#[$hidden])?
        impl Vector2 for $two {
            type Space = $three;
            #[inline]
            fn to_glam(self) -> DVec2 {
                self.into()
            }
            #[inline]
            fn from_glam(v: DVec2) -> Self {
                v.into()
            }
        }
        $(#[$hidden])?
        impl Vector3 for $three {
            type Image = $two;
            #[inline]
            fn to_glam(self) -> DVec3 {
                self.into()
            }
            #[inline]
            fn from_glam(v: DVec3) -> Self {
                v.into()
            }
        }
    };
}

vectors!([f64; 2], [f64; 3]);
// The crates of this workspace compute with glam's vectors.
vectors!(
    #[doc(hidden)]
    DVec2,
    DVec3
);
