//! A light source that follows its current in microseconds and fades over minutes, integrated over
//! exposures in closed form.
//!
//! The light relative to a cold source at full current is `y = x (1 - sum d_j h_j)`. The emission
//! `x` follows the drive `u` (0 to 1) by `x' = (u - x) / t_r`, the heat `h_j` of each part that warms by
//! `h_j' = (u - h_j) / t_j`. The drive is constant between commands; then the products `x h_j` obey a
//! linear equation too, so that `(1, x, h_j, x h_j, integral of y)` is a linear system with a
//! triangular matrix (the Carleman lift of a bilinear system, here with nothing cut off), and its
//! exponential is known in closed form: eigenvalues are 0, `-1/t_r`, `-1/t_j` and their sums.
//!
//! `integrals` has the entries of that exponential as sums of positive terms, so that no ratio of
//! the constants and no length of a step cancels digits; `model` steps and integrates, `source`
//! carries the state along device time.

mod integrals;
mod model;
mod source;

pub use model::{Model, State};
pub use source::{Emission, Source};

#[cfg(test)]
mod tests;
