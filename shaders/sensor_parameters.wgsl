// The sensor at one gain and exposure, for one frame: parameters of sensor/mod.rs and its
// submodules.

struct SensorParameters {
    // Seed and noise id, low half first.
    key: vec4u,
    read_noise_e: f32,
    full_well_e: f32,
    // Mean from which the full well may clip a pixel, so that shot and read noise are drawn
    // separately.
    apart_from_e: f32,
    dark_e: f32,
    gain_dn_per_e: f32,
    black_dn: f32,
    full_scale_dn: f32,
    // Exponent of the response.
    exponent: f32,
    pixels: u32,
    width: u32,
    // Half of the fraction of the excess over the full well that spills: this much goes in each
    // direction.
    bloom_share: f32,
    unused: u32,
}

@group(0) @binding(76) var<storage, read> sensor_parameters: SensorParameters;
