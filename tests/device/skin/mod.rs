//! Skin: its optics compared with an independent solution of diffusion theory and with a Monte
//! Carlo simulation of photons, and its effect on frames compared with closed forms.

mod depth;
mod frames;
mod model;
mod photons;
mod wall;
