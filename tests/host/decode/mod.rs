//! The decoder is tested on frames that are computed here from the patterns' formulas, in f64 and
//! without any code of the decoder. The error of the inliers, gross errors and coverage are tested
//! separately.

mod damage;
mod frames;
mod noise;
mod orders;
mod patterns;
mod random;
mod scene;
mod sparse;
