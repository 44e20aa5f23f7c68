//! The decoder on frames computed here from the patterns' formulas, in f64 and without any of the
//! decoder's code. Error of the inliers, gross errors and coverage are tested separately.

mod damage;
mod frames;
mod noise;
mod orders;
mod patterns;
mod random;
mod scene;
mod sparse;
