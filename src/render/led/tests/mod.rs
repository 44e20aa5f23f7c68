//! The light source against solutions of 100 digits and closed forms of its own limits.

mod model;
mod source;
