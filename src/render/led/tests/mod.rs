//! Compares the light source with 100-digit solutions and closed-form limits.

mod model;
mod source;
