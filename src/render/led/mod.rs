//! A light source with a rise time of microseconds and thermal droop over minutes, integrated over
//! exposures in closed form.
//!
//! The light relative to a cold source at full current is `y = x (1 - sum d_j h_j)`. The emission
//! `x` follows the drive `u` (0 to 1) by `x' = (u - x) / t_r`, the heat `h_j` of each warming part
//! by `h_j' = (u - h_j) / t_j`. The drive is constant between commands, so the products `x h_j`
//! also obey a linear equation and `(1, x, h_j, x h_j, integral of y)` is a linear system with a
//! triangular matrix (the Carleman lift of a bilinear system, here without truncation). Its
//! exponential is known in closed form: eigenvalues are 0, `-1/t_r`, `-1/t_j` and their sums.
//!
//! `integrals` computes the entries of this exponential as sums of positive terms, so that no ratio
//! of constants and no step length causes cancellation. `model` advances and integrates the state,
//! and `source` tracks it over device time.

mod integrals;
mod model;
mod source;

pub use model::{Model, State};
pub use source::{Emission, Source};

#[cfg(test)]
mod tests;
