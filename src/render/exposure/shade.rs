//! Shades sixteen samples at a time: computes the projector pixel whose light reaches each sample,
//! and the amount of light. The samples are structures of arrays in f64, so that loops vectorize.

use super::defocus::Defocus;
use super::flicker::Flicker;
use super::indirect_map::Gathering;
use super::lamps::Lamp;
use super::vignetting::Falloff;
use crate::scene::{Hits, Shaded, Wide, World};
use crate::skin::Skins;
use crate::{Plan, Term};
use glam::{DMat2, DVec2, DVec3};
use phasmid_core::simd::widest;
use phasmid_geometry::raycast::LANES;
use phasmid_geometry::{Lens, View};
use phasmid_profile::{self as profile, Profile, Scene};

/// Planck's constant times the speed of light, in J m (CODATA 2018, exact).
const HC: f64 = 6.626_070_15e-34 * 299_792_458.0;
/// Cosine of 80 degrees.
const COS_80: f64 = 0.173_648_177_666_930_33;

/// Parameters that convert geometry to electrons, the same for all samples.
pub(crate) struct Optics {
    pub(crate) camera: View,
    pub(crate) projector: View,
    /// Electrons per second in a pixel that views a white surface under 1 W/m^2.
    pub(crate) electrons_per_irradiance: f64,
    /// Radiant intensity of the projector at full white in W/sr.
    pub(crate) intensity_w_sr: f64,
    pub(crate) ambient_w_m2: f64,
    pub(crate) seen: Falloff,
    pub(crate) shown: Falloff,
    pub(crate) defocus: Defocus,
    /// Objects made of skin, and light transport in it.
    pub(crate) skins: Skins,
    /// Amplitude of the ambient light's flicker relative to its mean light.
    pub(crate) ambient_depth: f64,
    pub(crate) lamps: Vec<Lamp>,
    /// Settings for gathering interreflection; `None` if the scene does not enable it.
    pub(crate) interreflection: Option<Gathering>,
    /// Temporal waveform shared by all flickering light.
    pub(crate) flicker: Option<Flicker>,
}

impl Optics {
    /// The irradiance on the sensor is E = rho E_surface / (4 N^2) for a Lambertian surface under a
    /// lens of working f-number N (the camera equation, e.g. Ray: "Applied Photographic Optics").
    /// The number of electrons follows from E by pixel area, photon energy and quantum efficiency
    /// (EMVA 1288 release 4.0, equations 1 to 3).
    pub(crate) fn new(profile: &Profile, scene: &Scene) -> Self {
        let camera = &profile.camera;
        let of_lamps = scene.light.iter().find_map(profile::Light::pulse);
        let mains = scene.ambient.pulse().or(of_lamps);
        let photon_j = HC / (profile.projector.wavelength_nm * 1e-9);
        Self {
            camera: camera.view(),
            projector: profile.projector.view(),
            electrons_per_irradiance: camera.pixel_area_m2() * camera.sensor.quantum_efficiency
                / (4.0 * camera.f_number.powi(2) * photon_j),
            intensity_w_sr: profile.projector.radiant_intensity_w_sr,
            ambient_w_m2: scene.ambient.irradiance_w_m2,
            seen: Falloff::of_camera(camera),
            shown: Falloff::of_projector(&profile.projector),
            defocus: Defocus::new(&profile.projector),
            skins: Skins::new(profile, scene),
            ambient_depth: scene.ambient.flicker.map_or(0.0, |f| f.depth),
            lamps: Lamp::all(scene),
            interreflection: scene.interreflection.map(Gathering::new),
            flicker: mains.as_ref().map(Flicker::new),
        }
    }

    /// Returns the irradiance in W/m^2 of a surface under the projector's full white, given the
    /// square of its distance in mm^2 and the cosine of the angle of incidence.
    pub(crate) fn irradiance_w_m2(&self, cos: f64, distance2: f64) -> f64 {
        self.intensity_w_sr * 1e6 * cos / distance2
    }

    /// Returns the standard deviation of the projector's blur along x, in projector pixels, at a
    /// point in the rig's frame.
    pub(crate) fn blur_px(&self, point: DVec3) -> f32 {
        self.defocus.sigma_px(point) as f32
    }

    /// Applies the attenuation on the way to the camera's sensor to samples that have been shaded
    /// and lit by lamps.
    pub(crate) fn dim_seen(&self, directions: &[DVec3; LANES], shaded: &mut Shaded) {
        self.seen.dim_seen(directions, shaded);
    }

    /// Shades the hits of camera rays (`directions` with z = 1). The rays start at `origin`, a
    /// point of the camera's pupil, to which `Shaded::point` is relative.
    pub(crate) fn shade(
        &self,
        plan: &Plan,
        origin: DVec3,
        directions: &[DVec3; LANES],
        hits: &Hits,
        world: &World,
    ) -> Shaded {
        let mut albedo = [0.0; LANES];
        for lane in 0..LANES {
            if hits.is_hit(lane) {
                albedo[lane] = world
                    .materials
                    .first_albedo(plan, world.object(hits.surface[lane]));
            }
        }
        let slope = self.ray_slopes(plan, directions);
        let mut shaded = Shaded {
            point: [[0.0; LANES]; 3],
            px: [[0.0; LANES]; 2],
            footprint: [[[0.0; LANES]; 2]; 2],
            projected: [0.0; LANES],
            ambient: [0.0; LANES],
            flickering: [0.0; LANES],
            evenly: [0.0; LANES],
            lamps: [0; LANES],
            reachable: [false; LANES],
            square: [false; LANES],
        };
        pinhole(
            self,
            self.projector.center() - origin,
            &transpose(directions),
            hits,
            &albedo,
            &slope,
            &mut shaded,
        );
        if plan.has(Term::Interreflection) {
            shaded.evenly = albedo.map(|albedo| albedo * self.electrons_per_irradiance);
        }
        if plan.has(Term::ProjectorVignetting) {
            self.shown.dim_projected(&mut shaded);
        }
        if plan.has(Term::ProjectorDistortion) {
            distort(&self.projector.lens, &mut shaded);
        }
        self.in_field(&mut shaded);
        if plan.has(Term::ProjectorDefocus) {
            self.defocus.dim_border(&mut shaded);
        }
        shaded
    }

    /// Returns the derivatives of the rays (with z = 1) with respect to the camera pixel,
    /// `[component][camera axis]`.
    pub(crate) fn ray_slopes(&self, plan: &Plan, directions: &[DVec3; LANES]) -> [[Wide; 2]; 2] {
        let lens = &self.camera.lens;
        let scale = DMat2::from_diagonal(1.0 / lens.focal_px);
        let mut slopes = [
            [[scale.x_axis.x; LANES], [0.0; LANES]],
            [[0.0; LANES], [scale.y_axis.y; LANES]],
        ];
        if plan.has(Term::CameraDistortion) {
            for lane in 0..LANES {
                let ideal = directions[lane].truncate();
                let m = lens.distort_jacobian(ideal).inverse() * scale;
                for (component, row) in slopes.iter_mut().enumerate() {
                    row[0][lane] = m.x_axis[component];
                    row[1][lane] = m.y_axis[component];
                }
            }
        }
        slopes
    }

    fn in_field(&self, shaded: &mut Shaded) {
        let lens = &self.projector.lens;
        for lane in 0..LANES {
            let px = DVec2::new(shaded.px[0][lane], shaded.px[1][lane]);
            shaded.reachable[lane] &= lens.contains(px);
        }
    }
}

fn transpose(directions: &[DVec3; LANES]) -> [Wide; 3] {
    std::array::from_fn(|axis| directions.map(|d| d[axis]))
}

widest! {
    fn pinhole(
        optics: &Optics, pupil: DVec3, direction: &[Wide; 3], hits: &Hits, albedo: &Wide,
        slope: &[[Wide; 2]; 2], out: &mut Shaded,
    ) => pinhole_body
}

/// Computes everything except the distortion of the projector's lens. SIMD lanes of rays without a
/// hit hold arbitrary values.
#[inline(always)]
fn pinhole_body(
    optics: &Optics,
    pupil: DVec3,
    direction: &[Wide; 3],
    hits: &Hits,
    albedo: &Wide,
    slope: &[[Wide; 2]; 2],
    out: &mut Shaded,
) {
    // Rows of projector_from_rig are the columns of its inverse.
    let rotation = optics.projector.rig_from_view.rotation;
    let lens = &optics.projector.lens;
    let (focal, principal) = (lens.focal_px, lens.principal_px);
    let scale = optics.electrons_per_irradiance;
    let light = optics.intensity_w_sr * 1e6;
    for lane in 0..LANES {
        let d = DVec3::new(direction[0][lane], direction[1][lane], direction[2][lane]);
        let n = DVec3::new(
            hits.normal[0][lane],
            hits.normal[1][lane],
            hits.normal[2][lane],
        );
        let t = hits.t[lane];
        let p = d * t;
        let way = p - pupil;
        let distance2 = way.dot(way);
        let facing = n.dot(d);
        let cos_light = -n.dot(way) / distance2.sqrt();
        let cos_view = -facing / d.dot(d).sqrt();
        let local = DVec3::new(
            rotation.x_axis.dot(way),
            rotation.y_axis.dot(way),
            rotation.z_axis.dot(way),
        );
        let (x, y) = (local.x / local.z, local.y / local.z);
        out.point[0][lane] = p.x;
        out.point[1][lane] = p.y;
        out.point[2][lane] = p.z;
        out.px[0][lane] = x * focal.x + principal.x;
        out.px[1][lane] = y * focal.y + principal.y;
        // Inverse-square law with distances in millimetres.
        let cos = if cos_light > 0.0 { cos_light } else { 0.0 };
        out.projected[lane] = albedo[lane] * scale * light * cos / distance2;
        out.ambient[lane] = albedo[lane] * scale * optics.ambient_w_m2;
        out.reachable[lane] = (local.z > 0.0) & (cos_light > 0.0);
        out.square[lane] = (cos_light > COS_80) & (cos_view > COS_80);
        // Chain rule: from camera pixel to ray, to point on the tangent plane n . p = const, to
        // projector frame, to pattern image.
        for by in 0..2 {
            let (du, dv) = (slope[0][by][lane], slope[1][by][lane]);
            let dt = -t * (n.x * du + n.y * dv) / facing;
            let dp = DVec3::new(du * t + d.x * dt, dv * t + d.y * dt, d.z * dt);
            let dz = rotation.z_axis.dot(dp);
            out.footprint[0][by][lane] = focal.x * (rotation.x_axis.dot(dp) - x * dz) / local.z;
            out.footprint[1][by][lane] = focal.y * (rotation.y_axis.dot(dp) - y * dz) / local.z;
        }
    }
}

/// Applies the projector's lens distortion to pinhole coordinates and footprints.
fn distort(lens: &Lens, shaded: &mut Shaded) {
    for lane in 0..LANES {
        let px = DVec2::new(shaded.px[0][lane], shaded.px[1][lane]);
        let ideal = (px - lens.principal_px) / lens.focal_px;
        // Coordinates at which the distortion model folds back are invalid. They are set to NaN,
        // which lies outside every field.
        let distorted = lens.place(ideal).unwrap_or(DVec2::NAN);
        let scale = DMat2::from_diagonal(lens.focal_px);
        let jacobian = scale * lens.distort_jacobian(ideal) * scale.inverse();
        shaded.px[0][lane] = distorted.x;
        shaded.px[1][lane] = distorted.y;
        for by in 0..2 {
            let column =
                jacobian * DVec2::new(shaded.footprint[0][by][lane], shaded.footprint[1][by][lane]);
            shaded.footprint[0][by][lane] = column.x;
            shaded.footprint[1][by][lane] = column.y;
        }
    }
}
