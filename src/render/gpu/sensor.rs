//! Sensor pass on the GPU: converts `electrons` to the bytes of `frame`, or to `expected_dn`.
//! Equivalent of the CPU's `sensor/mod.rs`; the CPU generates the fixed pattern once.

use super::{Commands, Engine, EntryPoint, grid};
use crate::sensor::{FixedPattern, Sensor};
use crate::{Plan, Term};
use bytemuck::{Pod, Zeroable};
use phasmid_core::error::Result;

/// Equivalent of `SensorParameters` in `shaders/sensor_parameters.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Parameters {
    key: [u64; 2],
    read_noise_e: f32,
    full_well_e: f32,
    apart_from_e: f32,
    dark_e: f32,
    gain_dn_per_e: f32,
    black_dn: f32,
    full_scale_dn: f32,
    exponent: f32,
    pixels: u32,
    width: u32,
    bloom_share: f32,
    unused: u32,
}

/// The sensor of a camera.
pub(crate) struct SensorPass {
    plan: Plan,
    width: usize,
    pixels: usize,
    /// Fraction of the charge beyond the full well that spills into neighbouring pixels.
    bloom: f32,
}

impl SensorPass {
    /// Uploads the data that is the same for every frame. `blooming_percent` is the profile's value.
    pub(crate) fn new(
        engine: &mut Engine,
        plan: &Plan,
        (width, height): (usize, usize),
        blooming_percent: f64,
        fixed: Option<&FixedPattern>,
    ) -> Self {
        let pattern: Vec<[f32; 2]> = fixed.into_iter().flat_map(FixedPattern::pixels).collect();
        engine.write("fixed_pattern", bytemuck::cast_slice(&pattern));
        let pixels = width * height;
        if plan.has(Term::Blooming) {
            engine.reserve("bloom_excess", pixels as u64 * 4);
        }
        Self {
            plan: *plan,
            width,
            pixels,
            bloom: (blooming_percent / 100.0) as f32,
        }
    }

    /// Returns the bytes of a frame, without padding.
    pub(crate) fn frame_bytes(&self, sensor: &Sensor<'_>) -> usize {
        self.pixels * if sensor.numbers().wide { 2 } else { 1 }
    }

    /// Adds the passes that convert `electrons` (photoelectrons only; overwritten as scratch space)
    /// to `frame`.
    ///
    /// # Errors
    /// Returns an error under the same conditions as [`Engine::run`].
    pub(crate) fn read(
        &self,
        engine: &mut Engine,
        commands: &mut Commands,
        sensor: &Sensor<'_>,
    ) -> Result<()> {
        self.fill_wells(engine, commands, sensor)?;
        engine.reserve("frame", self.frame_bytes(sensor) as u64);
        let wide = f64::from(u8::from(sensor.numbers().wide));
        let stage = EntryPoint::new("sensor", "main", &self.plan).with("wide", wide);
        // Each thread packs four pixels.
        engine.run(commands, &stage, grid(self.pixels.div_ceil(4)))
    }

    /// Adds the passes that convert `electrons`, as in [`Self::read`], to `expected_dn`: unrounded
    /// digital numbers without shot and read noise, which tests compare with the CPU's numbers.
    ///
    /// # Errors
    /// Returns an error under the same conditions as [`Engine::run`].
    #[cfg(test)]
    pub(crate) fn expect(
        &self,
        engine: &mut Engine,
        commands: &mut Commands,
        sensor: &Sensor<'_>,
    ) -> Result<()> {
        self.fill_wells(engine, commands, sensor)?;
        engine.reserve("expected_dn", self.pixels as u64 * 4);
        let stage = EntryPoint::new("sensor", "expected", &self.plan);
        engine.run(commands, &stage, grid(self.pixels))
    }

    /// Adds the passes common to `read` and `expect`. With blooming, wells are first filled and
    /// their excess then spills.
    fn fill_wells(
        &self,
        engine: &mut Engine,
        commands: &mut Commands,
        sensor: &Sensor<'_>,
    ) -> Result<()> {
        let parameters = self.parameters(sensor);
        engine.write("sensor_parameters", bytemuck::bytes_of(&parameters));
        if self.plan.has(Term::Blooming) {
            let gather = EntryPoint::new("sensor_gather", "main", &self.plan);
            engine.run(commands, &gather, grid(self.pixels))?;
            let bloom = EntryPoint::new("bloom", "main", &self.plan);
            engine.run(commands, &bloom, grid(self.width))?;
        }
        Ok(())
    }

    fn parameters(&self, sensor: &Sensor<'_>) -> Parameters {
        let numbers = sensor.numbers();
        Parameters {
            key: numbers.key,
            read_noise_e: numbers.read_noise_e,
            full_well_e: numbers.full_well_e,
            // WGSL does not guarantee support for infinities.
            apart_from_e: numbers.apart_from_e.min(f32::MAX),
            dark_e: numbers.dark_e,
            gain_dn_per_e: numbers.gain_dn_per_e,
            black_dn: numbers.black_dn,
            full_scale_dn: numbers.full_scale_dn,
            exponent: numbers.exponent,
            pixels: self.pixels as u32,
            width: self.width as u32,
            bloom_share: 0.5 * self.bloom,
            unused: 0,
        }
    }
}
