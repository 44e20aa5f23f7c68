//! One surface sample: where the projector's light for it comes from, and how much of it arrives.

use super::world::{Hit, World};
use crate::geometry::View;
use crate::profile::{Profile, Scene};
use glam::{DMat2, DVec2, DVec3};

/// Planck's constant times the speed of light, in J m (CODATA 2018, exact).
const HC: f64 = 6.626_070_15e-34 * 299_792_458.0;

/// What turns geometry into electrons, the same for all samples.
pub(super) struct Optics {
    pub(super) camera: View,
    pub(super) projector: View,
    /// Electrons per second of a pixel that looks at a white surface under 1 W/m^2.
    electrons_per_irradiance: f64,
    /// Radiant intensity of the projector's white in W/sr.
    intensity_w_sr: f64,
    ambient_w_m2: f64,
}

/// A sample of the surface that a pixel sees.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// The point in the rig's frame in millimetres.
    pub(super) point: DVec3,
    /// Projector pixel that lights it.
    pub(super) projector_px: DVec2,
    /// d(projector px) / d(camera px): the sample's footprint on the slide. Column 0 is by the
    /// camera's column. Zero where the projector cannot reach: nobody asks for it there.
    pub(super) footprint: DMat2,
    /// Electrons per second under full white, shadow aside.
    pub(super) projected: f64,
    /// Electrons per second of ambient light.
    pub(super) ambient: f64,
    /// Whether the projector can light it, shadow aside: in its field and on its side.
    pub(super) reachable: bool,
    /// Whether both rays strike within 80 degrees of the normal.
    pub(super) square: bool,
}

impl Optics {
    /// Irradiance on the sensor is E = rho E_surface / (4 N^2) for a Lambertian surface under a
    /// lens of working f-number N (the camera equation, e.g. Ray: "Applied Photographic Optics");
    /// electrons follow from it by pixel area, photon energy and quantum efficiency (EMVA 1288
    /// release 4.0, equations 1 to 3).
    pub(super) fn new(profile: &Profile, scene: &Scene) -> Self {
        let camera = &profile.camera;
        let pixel_m2 = (camera.pixel_pitch_mm() * 1e-3).powi(2);
        let photon_j = HC / (profile.projector.wavelength_nm * 1e-9);
        Self {
            camera: camera.view(),
            projector: profile.projector.view(),
            electrons_per_irradiance: pixel_m2 * camera.sensor.quantum_efficiency
                / (4.0 * camera.f_number.powi(2) * photon_j),
            intensity_w_sr: profile.projector.radiant_intensity_w_sr,
            ambient_w_m2: scene.ambient.irradiance_w_m2,
        }
    }

    /// Derivative of the camera's ray (z = 1) by its pixel, at an ideal image point.
    pub(super) fn ray_slope(&self, direction: DVec3) -> DMat2 {
        let lens = &self.camera.lens;
        let scale = DMat2::from_diagonal(1.0 / lens.focal_px);
        if lens.is_distorted() {
            lens.distort_jacobian(direction.truncate()).inverse() * scale
        } else {
            scale
        }
    }

    /// The sample where a ray of the camera, `direction` with z = 1, meets the world.
    pub(super) fn sample(&self, direction: DVec3, hit: &Hit, world: &World) -> Sample {
        let point = direction * hit.t;
        let to_projector = self.projector.center() - point;
        let distance_mm = to_projector.length();
        let cos_light = hit.normal.dot(to_projector) / distance_mm;
        let cos_view = -hit.normal.dot(direction) / direction.length();
        let local = self.projector.rig_from_view.rotation.transpose() * -to_projector;
        let lens = &self.projector.lens;
        let in_front = local.z > 0.0;
        let ideal = local.truncate() / local.z;
        let projector_px = if in_front {
            lens.distort_to_px(ideal)
        } else {
            DVec2::NAN
        };
        let albedo = world.albedo(hit.surface);
        let distance_m = distance_mm * 1e-3;
        let irradiance = self.intensity_w_sr * cos_light.max(0.0) / (distance_m * distance_m);
        let reachable = in_front && cos_light > 0.0 && lens.contains(projector_px);
        let footprint = if reachable {
            self.footprint(direction, hit, local, ideal)
        } else {
            DMat2::ZERO
        };
        Sample {
            point,
            projector_px,
            footprint,
            projected: albedo * self.electrons_per_irradiance * irradiance,
            ambient: albedo * self.electrons_per_irradiance * self.ambient_w_m2,
            reachable,
            square: cos_light > COS_80 && cos_view > COS_80,
        }
    }

    /// Chain rule: camera pixel, ray, point on the tangent plane, projector's frame, slide.
    fn footprint(&self, direction: DVec3, hit: &Hit, local: DVec3, ideal: DVec2) -> DMat2 {
        let slope = self.ray_slope(direction);
        let facing = hit.normal.dot(direction);
        let lens = &self.projector.lens;
        let projector_from_rig = self.projector.rig_from_view.rotation.transpose();
        let column = |d: DVec2| {
            let d = d.extend(0.0);
            // The point slides along the tangent plane n . p = const.
            let dt = -hit.t * hit.normal.dot(d) / facing;
            let dp = projector_from_rig * (d * hit.t + direction * dt);
            (dp.truncate() - ideal * dp.z) / local.z
        };
        let d_ideal = DMat2::from_cols(column(slope.x_axis), column(slope.y_axis));
        let d_distorted = if lens.is_distorted() {
            lens.distort_jacobian(ideal) * d_ideal
        } else {
            d_ideal
        };
        DMat2::from_diagonal(lens.focal_px) * d_distorted
    }
}

/// Cosine of 80 degrees.
const COS_80: f64 = 0.173_648_177_666_930_33;
