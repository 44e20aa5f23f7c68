//! Skin: its optics against diffusion theory solved otherwise and against a Monte Carlo of photons,
//! and what it does to frames against closed forms.

mod depth;
mod frames;
mod model;
mod photons;
mod wall;
