//! The decoder against frames made here from the patterns' formulas, in f64 and without any of the
//! decoder's code. Inliers' error, gross errors and coverage are judged apart.

mod damage;
mod frames;
mod noise;
mod orders;
mod patterns;
mod random;
mod scene;
mod sparse;
