//! The emulated device, tested as a library.
//!
//! - Rendering: `rendering`, `geometry`, `pixel_aspect`, `textures`, `surfaces`, `lights`,
//!   `interreflection`, `skin`, `motion`, `plan`
//! - Light, sensor and shutter: `light`, `led`, `sensor`, `saturation`, `rolling`,
//!   `pattern_timing`, `pixel_formats`
//! - Control port: `dialects`, `port_faults`
//! - Files: `config_files`

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
mod pixel_aspect;
mod pixel_formats;
mod plan;
mod port_faults;
mod rendering;
mod rolling;
mod saturation;
mod sensor;
mod skin;
mod surfaces;
mod textures;
