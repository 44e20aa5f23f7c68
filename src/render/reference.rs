//! Reference renderer: slow, in f64, and without any shortcut of the production renderer. Tests
//! compare the passes with it.
//!
//! Every ray is tested against every triangle (Moller and Trumbore 1997) and, by an independent
//! method, against every solid (a frustum as twelve triangles, quadrics by the plain quadratic
//! formula). The signal of a pixel is the mean over rays through the pixel's whole area, each of
//! which looks up one pattern pixel; there are no footprints, derivatives or sums of patterns. With
//! a focus distance the rays also sample the whole pupil. Each ray evaluates one texel, one
//! interpolated vertex colour and one value of the microfacet formula; highlights use facet normals.

mod material;
mod microfacets;
mod primitive;

use crate::pattern_image::PatternImage;
use glam::{DVec2, DVec3};
use material::Material;
use phasmid_core::error::Result;
use phasmid_geometry::{Pose, View};
use phasmid_pattern::Axis;
use phasmid_profile::{Light, Profile, Response, Scene, Shape, Vignetting};
use primitive::{Crossing, Primitive, frustum};

/// A scene for the reference renderer, with lamps at their mean power, objects at rest, and neither
/// interreflection nor skin.
pub struct Reference {
    camera: View,
    projector: View,
    profile: Profile,
    ambient_w_m2: f64,
    lights: Vec<Light>,
    rig_from_scene: Pose,
    parts: Vec<Part>,
}

struct Part {
    surface: Primitive,
    rig_from_part: Pose,
    material: Material,
}

/// Hit of one camera ray.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Point in the rig's frame in millimetres.
    pub point: DVec3,
    /// Unit normal on the camera's side.
    pub normal: DVec3,
    /// Projector pixel whose ray passes through the point.
    pub projector_px: DVec2,
    /// Whether the point is in the projector's field, faces the projector and is not occluded from
    /// it.
    pub lit: bool,
    /// Unit vector from the point back along the ray.
    view: DVec3,
    /// Index of the object in the scene.
    part: usize,
    /// Albedo at the point.
    albedo: f64,
}

impl Reference {
    /// Loads a scene with the same meshes that the production renderer uses.
    ///
    /// # Errors
    /// Returns an error if a mesh or texture cannot be read.
    pub fn new(profile: &Profile, scene: &Scene) -> Result<Self> {
        let parts = scene
            .object
            .iter()
            .map(|object| {
                let scale = object.scale;
                let mut material = Material::new(object, &scene.folder)?;
                let surface = match &object.shape {
                    Shape::Plane { size_mm } => Primitive::Plane(
                        size_mm.map_or(DVec2::INFINITY, |s| DVec2::from(s) * scale / 2.0),
                    ),
                    Shape::Board { board, .. } => Primitive::Plane(board.sheet_mm() * scale / 2.0),
                    Shape::Sphere { radius_mm } => Primitive::Sphere(radius_mm * scale),
                    Shape::Cylinder {
                        radius_mm,
                        length_mm,
                    } => Primitive::Cylinder(radius_mm * scale, length_mm * scale / 2.0),
                    Shape::Frustum {
                        base_mm,
                        top_mm,
                        height_mm,
                    } => Primitive::Triangles(frustum(
                        base_mm * scale / 2.0,
                        top_mm * scale / 2.0,
                        height_mm * scale,
                    )),
                    other => {
                        let mesh = super::scene::mesh(other, &scene.folder)?;
                        material.take(object, &mesh);
                        let corner = |i: u32| mesh.vertices[i as usize] * scale;
                        Primitive::Triangles(mesh.triangles.iter().map(|t| t.map(corner)).collect())
                    }
                };
                Ok(Part {
                    surface,
                    rig_from_part: scene.rig_from_object(object),
                    material,
                })
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            camera: profile.camera.view(),
            projector: profile.projector.view(),
            profile: profile.clone(),
            ambient_w_m2: scene.ambient.irradiance_w_m2,
            lights: scene.light.clone(),
            rig_from_scene: scene.rig_from_scene(),
            parts,
        })
    }

    /// Returns the hit of the camera ray through an image point; `None` if the ray leaves the scene.
    pub fn trace(&self, px: DVec2) -> Option<Found> {
        self.follow(self.camera.center(), self.camera.ray(px).normalize())
    }

    /// Returns the hit of a ray with a unit direction.
    fn follow(&self, origin: DVec3, direction: DVec3) -> Option<Found> {
        let (
            part,
            Crossing {
                t,
                triangle,
                normal,
            },
        ) = self.first(origin, direction, 0.0)?;
        let point = origin + direction * t;
        let Part {
            surface,
            rig_from_part,
            material,
        } = &self.parts[part];
        let normal = if normal.dot(direction) > 0.0 {
            -normal
        } else {
            normal
        };
        let local = rig_from_part.inverse();
        let albedo = material.albedo(
            surface,
            triangle,
            local.point(point),
            local.direction(normal),
        );
        let pupil = self.projector.center();
        let way = point - pupil;
        let projected = self.projector.project(point);
        let in_field = projected.is_some_and(|px| self.projector.lens.contains(px));
        let facing = normal.dot(way) < 0.0;
        let clear = || match self.first(pupil, way.normalize(), 0.0) {
            Some((_, Crossing { t, .. })) => t > way.length() * (1.0 - 1e-9),
            None => true,
        };
        Some(Found {
            point,
            normal,
            projector_px: projected.unwrap_or(DVec2::NAN),
            lit: in_field && facing && clear(),
            view: -direction,
            part,
            albedo,
        })
    }

    /// Returns the signal of a pixel in digital numbers, without noise and rounding. It is the mean
    /// over `rays` rays through the pixel's area, placed as a Hammersley set. Such a set is uniform
    /// and has no period that could alias with the pattern.
    pub fn signal_dn(
        &self,
        px: DVec2,
        pattern_image: &PatternImage,
        exposure_s: f64,
        rays: u32,
    ) -> f64 {
        let mean = (0..rays)
            .map(|i| {
                let u = (f64::from(i) + 0.5) / f64::from(rays) - 0.5;
                let v = mirrored(i, 2) + 0.5 / f64::from(rays) - 0.5;
                let (blur, pupil) = (
                    [3, 5].map(|b| mirrored(i, b)),
                    [7, 11].map(|b| mirrored(i, b)),
                );
                self.irradiance(px + DVec2::new(u, v), pupil, pattern_image, blur)
            })
            .sum::<f64>()
            / f64::from(rays);
        let camera = &self.profile.camera;
        let sensor = &camera.sensor;
        // Camera equation E = rho E_surface / (4 N^2); the energy of a photon is h c / lambda.
        let photon_j =
            6.626_070_15e-34 * 299_792_458.0 / (self.profile.projector.wavelength_nm * 1e-9);
        let pixel_width_m = camera.sensor_width_mm / f64::from(camera.width_px) * 1e-3;
        let area_m2 = pixel_width_m * (pixel_width_m / camera.pixel_aspect);
        let on_sensor = mean / (4.0 * camera.f_number * camera.f_number);
        let electrons = sensor.quantum_efficiency * on_sensor * area_m2 * exposure_s / photon_j;
        let dn = electrons.min(sensor.full_well_e) * sensor.gain_dn_per_e + sensor.black_level_dn;
        dn.min(f64::from((1u32 << sensor.bits) - 1))
    }

    /// Returns the ray through an image point from a pupil position, which is given by two numbers
    /// from 0 to 1. With a focus distance, the ray starts at the pupil position and passes through
    /// the point where the pinhole ray meets the focal plane.
    fn sight(&self, px: DVec2, [share, turn]: [f64; 2]) -> (DVec3, DVec3) {
        let (center, ray) = (self.camera.center(), self.camera.ray(px));
        let camera = &self.profile.camera;
        let Some(focus) = camera.focus_mm else {
            return (center, ray.normalize());
        };
        let radius = camera.focal_length_mm / camera.f_number / 2.0;
        // Samples are uniform in area, not in radius.
        let place = DVec2::from_angle(turn * std::f64::consts::TAU) * radius * share.sqrt();
        let from = center + place.extend(0.0);
        (from, (center + ray * focus - from).normalize())
    }

    /// Returns the light that is reflected towards an image point from a pupil position, as the
    /// irradiance in W/m^2 of a white Lambertian surface that would reflect as much. The pattern is
    /// sampled at one position within the projector's blur, chosen by two numbers from 0 to 1.
    fn irradiance(
        &self,
        px: DVec2,
        pupil: [f64; 2],
        pattern_image: &PatternImage,
        blur: [f64; 2],
    ) -> f64 {
        let (origin, direction) = self.sight(px, pupil);
        let Some(found) = self.follow(origin, direction) else {
            return 0.0;
        };
        let projector = &self.profile.projector;
        let material = &self.parts[found.part].material;
        let thrown_back = |towards: DVec3| {
            material.reflectance(found.albedo, found.normal, towards, found.view)
                * found.normal.dot(towards)
        };
        let cos_view = found.normal.dot(found.view);
        let mut irradiance = self.ambient_w_m2 * material.under_even_light(found.albedo, cos_view);
        if found.lit {
            let way = self.projector.center() - found.point;
            let px = found.projector_px + self.blur(found.point, blur);
            let on_pattern_image = self.projector.lens.contains(px);
            let level = level(pattern_image, px) / f64::from((1u32 << projector.bits) - 1);
            let shown = match &projector.response {
                None => level,
                Some(Response::Gamma(gamma)) => level.powf(*gamma),
                Some(Response::Table(table)) => {
                    let steps = (table.len() - 1) as f64;
                    // Linear interpolation: each table value has a triangular weight two table steps
                    // wide.
                    let under = |(i, light): (usize, &f64)| {
                        light * (1.0 - (level * steps - i as f64).abs()).max(0.0)
                    };
                    table.iter().enumerate().map(under).sum()
                }
            };
            let ratio = projector.contrast_ratio.unwrap_or(f64::INFINITY);
            let light = if on_pattern_image {
                (1.0 - 1.0 / ratio).mul_add(shown, 1.0 / ratio)
            } else {
                0.0
            };
            let axis = self.projector.rig_from_view.direction(DVec3::Z);
            let off_axis = -axis.dot(way.normalize());
            let falloff = falloff(&projector.vignetting, &self.projector, off_axis, 1);
            irradiance +=
                light * falloff * projector.radiant_intensity_w_sr * thrown_back(way.normalize())
                    / (way.length_squared() * 1e-6);
        }
        for light in &self.lights {
            let (towards, facing) = self.lamp(light, &found);
            if facing > 0.0 {
                irradiance += facing * thrown_back(towards);
            }
        }
        let off_axis = self.camera.lens.ray(px).normalize().z;
        let camera = &self.profile.camera;
        irradiance * falloff(&camera.vignetting, &self.camera, off_axis, 4)
    }

    /// Returns a random offset, in projector pixels, within the projector's blur at a point. The
    /// blur disc is the section, by the plane through `point`, of the cone of light from the
    /// aperture to a point of the focal plane. The offset is drawn from a Gaussian with a standard
    /// deviation of a quarter of the disc's diameter (Box and Muller 1958).
    fn blur(&self, point: DVec3, [u, v]: [f64; 2]) -> DVec2 {
        let Some(focus) = self.profile.projector.focus else {
            return DVec2::ZERO;
        };
        let z = self.projector.rig_from_view.inverse().point(point).z;
        let covered_mm = focus.aperture_mm * (z - focus.distance_mm).abs() / focus.distance_mm;
        let pixel_mm = z / self.projector.lens.focal_px;
        let radius_mm = (-2.0 * (1.0 - u).ln()).sqrt() * covered_mm / 4.0;
        DVec2::from_angle(v * std::f64::consts::TAU) * radius_mm / pixel_mm
    }

    /// Returns the direction from a point to a lamp, and the irradiance in W/m^2 of a surface at the
    /// point that faces the lamp; 0 if the lamp is occluded.
    fn lamp(&self, light: &Light, found: &Found) -> (DVec3, f64) {
        let (way, facing) = match *light {
            Light::Point {
                position_mm,
                intensity_w_sr,
                ..
            } => {
                let at = self.rig_from_scene.point(DVec3::from(position_mm));
                let way = at - found.point;
                (way, intensity_w_sr / (way.length_squared() * 1e-6))
            }
            Light::Directional {
                direction,
                irradiance_w_m2,
                ..
            } => {
                let along = self.rig_from_scene.direction(DVec3::from(direction));
                (along.normalize() * -1e12, irradiance_w_m2)
            }
        };
        let towards = way.normalize();
        let near = found.point.length() * 1e-5;
        let shaded = self
            .first(found.point, towards, near)
            .is_some_and(|(_, Crossing { t, .. })| t < way.length());
        let shines = found.normal.dot(towards) > 0.0 && !shaded;
        (towards, if shines { facing } else { 0.0 })
    }

    /// Returns the nearest object along a ray with a unit direction, and its intersection.
    fn first(&self, origin: DVec3, direction: DVec3, t_min: f64) -> Option<(usize, Crossing)> {
        let mut nearest: Option<(usize, Crossing)> = None;
        for (i, part) in self.parts.iter().enumerate() {
            let inverse = part.rig_from_part.inverse();
            let (o, d) = (inverse.point(origin), inverse.direction(direction));
            for met in part.surface.crossings(o, d) {
                if met.t > t_min && nearest.is_none_or(|(_, n)| met.t < n.t) {
                    let normal = part.rig_from_part.direction(met.normal);
                    nearest = Some((i, Crossing { normal, ..met }));
                }
            }
        }
        nearest
    }
}

/// Returns the relative illumination that vignetting leaves at an angle to the axis with this
/// cosine; `cosines` is the exponent of the natural falloff.
fn falloff(vignetting: &Vignetting, view: &View, cos: f64, cosines: i32) -> f64 {
    let lens = &view.lens;
    let [width, height] = [lens.width_px, lens.height_px].map(f64::from);
    let diagonal = (width / lens.focal_px.x).hypot(height / lens.focal_px.y);
    let r = cos.acos().tan() / (diagonal / 2.0);
    let [a2, a4, a6] = vignetting.falloff;
    let natural = if vignetting.natural {
        cos.powi(cosines)
    } else {
        1.0
    };
    natural * (1.0 + a2 * r.powi(2) + a4 * r.powi(4) + a6 * r.powi(6))
}

/// Returns the level of the pattern pixel that contains a projector coordinate.
fn level(pattern_image: &PatternImage, px: DVec2) -> f64 {
    let index = |x: f64, len: usize| ((x + 0.5).floor().max(0.0) as usize).min(len - 1);
    f64::from(match pattern_image {
        PatternImage::Uniform(level) => *level,
        PatternImage::Row(Axis::X, row) => row[index(px.x, row.len())],
        PatternImage::Row(Axis::Y, row) => row[index(px.y, row.len())],
        PatternImage::Image {
            width,
            height,
            levels,
        } => {
            let (x, y) = (index(px.x, *width as usize), index(px.y, *height as usize));
            levels[y * *width as usize + x]
        }
    })
}

/// Returns the radical inverse of a number in a base (van der Corput): its digits mirrored at the
/// radix point, which gives a number from 0 to 1.
fn mirrored(mut number: u32, base: u32) -> f64 {
    let (mut digit, mut sum) = (1.0, 0.0);
    while number > 0 {
        digit /= f64::from(base);
        sum += digit * f64::from(number % base);
        number /= base;
    }
    sum
}
