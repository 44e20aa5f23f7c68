//! The device: rendering, light, sensor, projector, timing, dialects and faults of the port.

#[path = "../support/photometry.rs"]
mod photometry;

mod config_files;
mod dialects;
mod geometry;
mod interreflection;
mod led;
mod light;
mod lights;
mod motion;
mod pattern_timing;
mod plan;
mod port_faults;
mod rendering;
mod rolling;
mod saturation;
mod sensor;
mod skin;
mod surfaces;
mod textures;
