//! The reference path: slow, in f64, and without any shortcut of the fast path. Tests hold the
//! passes against it.
//!
//! Every ray is tested against every triangle (Moller and Trumbore 1997) and every solid by a
//! second method (a frustum as twelve triangles, quadrics by the plain quadratic formula). A
//! pixel's signal is the mean over rays through its whole area, each of which looks up one held
//! pixel of the slide: no footprints, no derivatives, no sums of the slide. With a focus they also
//! go through its whole pupil.

use crate::emulator::Slide;
use crate::error::Result;
use crate::geometry::{Pose, View};
use crate::pattern::Axis;
use crate::profile::{Light, Profile, Response, Scene, Shape, Vignetting};
use glam::{DVec2, DVec3};

/// A scene as the reference path sees it: Lambertian surfaces, lamps at their mean, everything
/// where it rests.
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
    albedo: f64,
}

enum Primitive {
    Triangles(Vec<[DVec3; 3]>),
    Plane(DVec2),
    Sphere(f64),
    /// Radius and half length along y.
    Cylinder(f64, f64),
}

/// What one ray of the camera finds.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Point in the rig's frame in millimetres.
    pub point: DVec3,
    /// Unit normal on the camera's side.
    pub normal: DVec3,
    /// Projector pixel that the point lies on the ray of.
    pub projector_px: DVec2,
    /// In the projector's field, facing it, and with nothing between.
    pub lit: bool,
    albedo: f64,
}

impl Reference {
    /// Takes a scene; meshes are those that the fast path would load.
    ///
    /// # Errors
    /// Mesh files that cannot be read.
    pub fn new(profile: &Profile, scene: &Scene) -> Result<Self> {
        let parts = scene
            .object
            .iter()
            .map(|object| {
                let scale = object.scale;
                let surface = match &object.shape {
                    Shape::Plane { size_mm } => Primitive::Plane(
                        size_mm.map_or(DVec2::INFINITY, |s| DVec2::from(s) * scale / 2.0),
                    ),
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
                        let mesh = super::shape::mesh(other, &scene.folder)?;
                        let corner = |i: u32| mesh.vertices[i as usize] * scale;
                        Primitive::Triangles(mesh.triangles.iter().map(|t| t.map(corner)).collect())
                    }
                };
                Ok(Part {
                    surface,
                    rig_from_part: scene.rig_from_object(object),
                    albedo: object.albedo,
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

    /// What the ray through a point of the image finds; `None` if it leaves the scene.
    pub fn look(&self, px: DVec2) -> Option<Found> {
        self.follow(self.camera.center(), self.camera.ray(px).normalize())
    }

    /// What a ray with a unit direction finds.
    fn follow(&self, origin: DVec3, direction: DVec3) -> Option<Found> {
        let (t, normal, albedo) = self.first(origin, direction, 0.0)?;
        let point = origin + direction * t;
        let normal = if normal.dot(direction) > 0.0 {
            -normal
        } else {
            normal
        };
        let pupil = self.projector.center();
        let way = point - pupil;
        let projected = self.projector.project(point);
        let in_field = projected.is_some_and(|px| self.projector.lens.contains(px));
        let facing = normal.dot(way) < 0.0;
        let clear = || match self.first(pupil, way.normalize(), 0.0) {
            Some((t, ..)) => t > way.length() * (1.0 - 1e-9),
            None => true,
        };
        Some(Found {
            point,
            normal,
            projector_px: projected.unwrap_or(DVec2::NAN),
            lit: in_field && facing && clear(),
            albedo,
        })
    }

    /// Noise-free signal of a pixel in digital numbers, not rounded: the mean over `rays` rays
    /// through its area, spread as a lattice (Korobov) that is even along every direction.
    pub fn signal_dn(&self, px: DVec2, slide: &Slide, exposure_s: f64, rays: u32) -> f64 {
        let golden = 0.618_033_988_749_894_9;
        let mean = (0..rays)
            .map(|i| {
                let u = (f64::from(i) + 0.5) / f64::from(rays) - 0.5;
                let v = (f64::from(i) * golden).fract() - 0.5;
                // More directions of the lattice: roots of primes share nothing with it.
                let root = |n: f64| (f64::from(i) * n.sqrt() + 0.5).fract();
                let (blur, pupil) = ([2.0, 3.0].map(root), [7.0, 11.0].map(root));
                self.irradiance(px + DVec2::new(u, v), pupil, slide, blur)
            })
            .sum::<f64>()
            / f64::from(rays);
        let camera = &self.profile.camera;
        let sensor = &camera.sensor;
        // E = rho E_surface / (4 N^2); photons by h c / lambda.
        let photon_j =
            6.626_070_15e-34 * 299_792_458.0 / (self.profile.projector.wavelength_nm * 1e-9);
        let area_m2 = (camera.sensor_width_mm / f64::from(camera.width_px) * 1e-3).powi(2);
        let on_sensor = mean / (4.0 * camera.f_number * camera.f_number);
        let electrons = sensor.quantum_efficiency * on_sensor * area_m2 * exposure_s / photon_j;
        let dn = electrons.min(sensor.full_well_e) * sensor.gain_dn_per_e + sensor.black_level_dn;
        dn.min(f64::from((1u32 << sensor.bits) - 1))
    }

    /// The ray through a point of the image and a place of the pupil, two numbers from 0 to 1: with
    /// a focus it leaves that place for the point that the pinhole's ray has in the plane in focus.
    fn sight(&self, px: DVec2, [share, turn]: [f64; 2]) -> (DVec3, DVec3) {
        let (center, ray) = (self.camera.center(), self.camera.ray(px));
        let camera = &self.profile.camera;
        let Some(focus) = camera.focus_mm else {
            return (center, ray.normalize());
        };
        let radius = camera.focal_length_mm / camera.f_number / 2.0;
        // Areas, not radii, are even.
        let place = DVec2::from_angle(turn * std::f64::consts::TAU) * radius * share.sqrt();
        let from = center + place.extend(0.0);
        (from, (center + ray * focus - from).normalize())
    }

    /// Albedo times irradiance of the surface at a point of the image seen from a place of the
    /// pupil, in W/m^2; the slide is looked up at one place of the blur about the point, which two
    /// numbers of 0 to 1 choose.
    fn irradiance(&self, px: DVec2, pupil: [f64; 2], slide: &Slide, blur: [f64; 2]) -> f64 {
        let (origin, direction) = self.sight(px, pupil);
        let Some(found) = self.follow(origin, direction) else {
            return 0.0;
        };
        let projector = &self.profile.projector;
        let mut irradiance = self.ambient_w_m2;
        if found.lit {
            let way = self.projector.center() - found.point;
            let cos = found.normal.dot(way.normalize());
            let px = found.projector_px + self.blur(found.point, blur);
            let on_slide = self.projector.lens.contains(px);
            let level = level(slide, px) / f64::from((1u32 << projector.bits) - 1);
            let shown = match &projector.response {
                None => level,
                Some(Response::Gamma(gamma)) => level.powf(*gamma),
                Some(Response::Table(table)) => {
                    let steps = (table.len() - 1) as f64;
                    // Each value holds under a triangle as wide as two steps.
                    let under = |(i, light): (usize, &f64)| {
                        light * (1.0 - (level * steps - i as f64).abs()).max(0.0)
                    };
                    table.iter().enumerate().map(under).sum()
                }
            };
            let ratio = projector.contrast_ratio.unwrap_or(f64::INFINITY);
            let light = if on_slide {
                (1.0 - 1.0 / ratio).mul_add(shown, 1.0 / ratio)
            } else {
                0.0
            };
            let axis = self.projector.rig_from_view.direction(DVec3::Z);
            let off_axis = -axis.dot(way.normalize());
            let falloff = falloff(&projector.vignetting, &self.projector, off_axis, 1);
            irradiance += light * falloff * projector.radiant_intensity_w_sr * cos
                / (way.length_squared() * 1e-6);
        }
        for light in &self.lights {
            irradiance += self.lamp(light, &found);
        }
        let off_axis = self.camera.lens.ray(px).normalize().z;
        let camera = &self.profile.camera;
        found.albedo * irradiance * falloff(&camera.vignetting, &self.camera, off_axis, 4)
    }

    /// A draw of the projector's blur about a point, in slide pixels. The cone of light from the
    /// aperture to a point of the focused plane is cut by the plane through the given point; what
    /// it covers there, measured in the slide's pixels, is the blur's disc, of which a Gaussian of
    /// a quarter of its diameter is drawn (Box and Muller 1958).
    fn blur(&self, point: DVec3, [u, v]: [f64; 2]) -> DVec2 {
        let Some(focus) = self.profile.projector.focus else {
            return DVec2::ZERO;
        };
        let z = self.projector.rig_from_view.inverse().point(point).z;
        let covered_mm = focus.aperture_mm * (z - focus.distance_mm).abs() / focus.distance_mm;
        let pixel_mm = z / self.projector.lens.focal_px.x;
        let radius = (-2.0 * (1.0 - u).ln()).sqrt() * covered_mm / pixel_mm / 4.0;
        DVec2::from_angle(v * std::f64::consts::TAU) * radius
    }

    /// Irradiance in W/m^2 that a lamp gives a point.
    fn lamp(&self, light: &Light, found: &Found) -> f64 {
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
        let cos = found.normal.dot(way.normalize());
        let near = found.point.length() * 1e-5;
        let shaded = self
            .first(found.point, way.normalize(), near)
            .is_some_and(|(t, ..)| t < way.length());
        if cos > 0.0 && !shaded {
            facing * cos
        } else {
            0.0
        }
    }

    /// Nearest surface along a ray with a unit direction: distance, normal, albedo.
    fn first(&self, origin: DVec3, direction: DVec3, t_min: f64) -> Option<(f64, DVec3, f64)> {
        let mut nearest: Option<(f64, DVec3, f64)> = None;
        for part in &self.parts {
            let inverse = part.rig_from_part.inverse();
            let (o, d) = (inverse.point(origin), inverse.direction(direction));
            for (t, normal) in part.surface.crossings(o, d) {
                if t > t_min && nearest.is_none_or(|n| t < n.0) {
                    nearest = Some((t, part.rig_from_part.direction(normal), part.albedo));
                }
            }
        }
        nearest
    }
}

impl Primitive {
    fn crossings(&self, o: DVec3, d: DVec3) -> Vec<(f64, DVec3)> {
        match self {
            Self::Triangles(triangles) => triangles
                .iter()
                .filter_map(|t| moller_trumbore(t, o, d))
                .collect(),
            Self::Plane(half) => {
                let t = -o.z / d.z;
                let p = o + d * t;
                let inside = p.x.abs() <= half.x && p.y.abs() <= half.y;
                if inside && t.is_finite() {
                    vec![(t, DVec3::NEG_Z)]
                } else {
                    vec![]
                }
            }
            Self::Sphere(r) => quadratic(d.dot(d), 2.0 * o.dot(d), o.dot(o) - r * r)
                .map(|t| (t, (o + d * t).normalize()))
                .collect(),
            Self::Cylinder(r, half) => {
                let flat = DVec3::new(1.0, 0.0, 1.0);
                let (fo, fd) = (o * flat, d * flat);
                let side = quadratic(fd.dot(fd), 2.0 * fo.dot(fd), fo.dot(fo) - r * r)
                    .map(|t| (t, ((o + d * t) * flat).normalize()))
                    .filter(|(t, _)| (o.y + d.y * t).abs() <= *half);
                let caps = [1.0, -1.0]
                    .map(|s| ((s * half - o.y) / d.y, DVec3::Y * s))
                    .into_iter()
                    .filter(|(t, _)| ((o + d * *t) * flat).length() <= *r);
                side.chain(caps).collect()
            }
        }
    }
}

/// What vignetting leaves at an angle of this cosine to the axis, `cosines` of the natural fall.
fn falloff(vignetting: &Vignetting, view: &View, cos: f64, cosines: i32) -> f64 {
    let lens = &view.lens;
    let diagonal = f64::from(lens.width_px).hypot(f64::from(lens.height_px));
    let r = cos.acos().tan() * lens.focal_px.x / (diagonal / 2.0);
    let [a2, a4, a6] = vignetting.falloff;
    let natural = if vignetting.natural {
        cos.powi(cosines)
    } else {
        1.0
    };
    natural * (1.0 + a2 * r.powi(2) + a4 * r.powi(4) + a6 * r.powi(6))
}

fn quadratic(a: f64, b: f64, c: f64) -> impl Iterator<Item = f64> {
    let root = (b * b - 4.0 * a * c).sqrt();
    [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)]
        .into_iter()
        .filter(|t| t.is_finite())
}

fn moller_trumbore([a, b, c]: &[DVec3; 3], o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
    let (e1, e2) = (*b - *a, *c - *a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = o - *a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = d.dot(q) / det;
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    inside.then(|| (e2.dot(q) / det, e1.cross(e2).normalize()))
}

/// Two triangles for each of the six faces.
fn frustum(base: f64, top: f64, height: f64) -> Vec<[DVec3; 3]> {
    let ring = |half: f64, z: f64| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| DVec3::new(x * half, y * half, z))
    };
    let (b, t) = (ring(base, 0.0), ring(top, -height));
    let mut faces = vec![[b[0], b[1], b[2], b[3]], [t[0], t[1], t[2], t[3]]];
    faces.extend((0..4).map(|i| [b[i], b[(i + 1) % 4], t[(i + 1) % 4], t[i]]));
    faces
        .into_iter()
        .flat_map(|[p, q, r, s]| [[p, q, r], [p, r, s]])
        .collect()
}

/// Level of the held pixel that a projector coordinate lies in.
fn level(slide: &Slide, px: DVec2) -> f64 {
    let index = |x: f64, len: usize| ((x + 0.5).floor().max(0.0) as usize).min(len - 1);
    f64::from(match slide {
        Slide::Uniform(level) => *level,
        Slide::Row(Axis::X, row) => row[index(px.x, row.len())],
        Slide::Row(Axis::Y, row) => row[index(px.y, row.len())],
        Slide::Picture {
            width,
            height,
            levels,
        } => {
            let (x, y) = (index(px.x, *width as usize), index(px.y, *height as usize));
            levels[y * *width as usize + x]
        }
    })
}
