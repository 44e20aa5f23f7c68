//! Closed forms for a rig and two surfaces: they map a camera pixel to the projector pixel that
//! lights the point seen by that camera pixel.

use glam::{DVec2, DVec3};
use phasmid::profile::Profile;

/// A rig with the camera at the origin, looking along z, and the projector rotated only about y.
pub struct Rig {
    profile: Profile,
    camera_focal_px: f64,
    camera_principal_px: DVec2,
    projector_focal_px: f64,
    projector_principal_px: DVec2,
    pupil: DVec3,
    turn: f64,
}

/// A surface that a ray from the origin meets at most once.
pub trait Surface: Sync {
    /// Returns the point where a ray meets the surface, and the unit normal towards the camera. The
    /// ray starts at the origin, and its direction has z = 1.
    fn meet(&self, ray: DVec3) -> Option<(DVec3, DVec3)>;
    /// Returns the scene with this surface as TOML, without name and description.
    fn toml(&self) -> String;
    /// Returns the factor on the tolerance of 1e-9 px of the reference renderer, for points where
    /// the last bit of the input moves the result by more; `None` if the reference renderer is not
    /// tested there.
    fn condition(&self, rig: &Rig, px: DVec2) -> Option<f64>;
}

/// An infinite plane through (0, 0, z), rotated about y.
pub struct Plane {
    pub tilt_deg: f64,
    pub z_mm: f64,
}

pub struct Sphere {
    pub center_mm: DVec3,
    pub radius_mm: f64,
}

impl Surface for Plane {
    fn meet(&self, ray: DVec3) -> Option<(DVec3, DVec3)> {
        let (sin, cos) = self.tilt_deg.to_radians().sin_cos();
        // On the plane, x sin + (z - z0) cos = 0.
        let speed = ray.x * sin + ray.z * cos;
        let t = self.z_mm * cos / speed;
        let towards = -speed.signum();
        (t > 0.0 && t.is_finite()).then(|| (ray * t, DVec3::new(sin, 0.0, cos) * towards))
    }

    fn toml(&self) -> String {
        format!(
            "[[object]]\nshape = {{ kind = \"plane\" }}\nalbedo = 0.5\n\
             position_mm = [0, 0, {:?}]\nrotation_deg = [0, {:?}, 0]\n",
            self.z_mm, self.tilt_deg
        )
    }

    fn condition(&self, rig: &Rig, px: DVec2) -> Option<f64> {
        // The closer a pixel is to the horizon, the larger the area of the pattern image that it
        // covers.
        Some(rig.footprint(self, px).max(1.0))
    }
}

impl Surface for Sphere {
    fn meet(&self, ray: DVec3) -> Option<(DVec3, DVec3)> {
        let unit = ray.normalize();
        let along = unit.dot(self.center_mm);
        // Distance of the ray from the centre: area of a parallelogram divided by its side.
        let off = unit.cross(self.center_mm).length();
        let half = ((self.radius_mm - off) * (self.radius_mm + off)).sqrt();
        let point = unit * (along - half);
        half.is_finite()
            .then(|| (point, (point - self.center_mm) / self.radius_mm))
    }

    fn toml(&self) -> String {
        let c = self.center_mm;
        format!(
            "[[object]]\nshape = {{ kind = \"sphere\", radius_mm = {:?} }}\nalbedo = 0.5\n\
             position_mm = [{:?}, {:?}, {:?}]\n",
            self.radius_mm, c.x, c.y, c.z
        )
    }

    fn condition(&self, rig: &Rig, px: DVec2) -> Option<f64> {
        // At the silhouette, where the surface ends within a pixel, the point moves with the square
        // root of the pixel coordinate.
        let footprint = rig.footprint(self, px);
        Some(if footprint.is_finite() {
            footprint.max(1.0)
        } else {
            1e4
        })
    }
}

impl Rig {
    pub fn new(profile: &Profile) -> Self {
        let (c, p) = (&profile.camera, &profile.projector);
        let middle = |w: u32, h: u32| DVec2::new(f64::from(w) - 1.0, f64::from(h) - 1.0) / 2.0;
        assert_eq!((p.rotation_deg[0], p.rotation_deg[2]), (0.0, 0.0));
        Self {
            camera_focal_px: c.focal_length_mm * f64::from(c.width_px) / c.sensor_width_mm,
            camera_principal_px: middle(c.width_px, c.height_px),
            projector_focal_px: p.throw_ratio * f64::from(p.width_px),
            projector_principal_px: middle(p.width_px, p.height_px) + DVec2::from(p.lens_shift_px),
            pupil: DVec3::from(p.position_mm),
            turn: p.rotation_deg[1].to_radians(),
            profile: profile.clone(),
        }
    }

    fn ray(&self, px: DVec2) -> DVec3 {
        if self.profile.camera.distortion == [0.0; 5] {
            ((px - self.camera_principal_px) / self.camera_focal_px).extend(1.0)
        } else {
            self.profile.camera.view().lens.ray(px)
        }
    }

    /// Returns the projector pixel whose ray passes through the point that a camera pixel sees; NaN
    /// if the point is behind the projector.
    pub fn lit_from(&self, surface: &(impl Surface + ?Sized), px: DVec2) -> Option<DVec2> {
        let (point, _) = surface.meet(self.ray(px))?;
        let way = point - self.pupil;
        // Rotate by -turn about y into the projector's frame.
        let (sin, cos) = self.turn.sin_cos();
        let local = DVec3::new(way.x * cos - way.z * sin, way.y, way.x * sin + way.z * cos);
        if local.z <= 0.0 {
            return Some(DVec2::NAN);
        }
        let mut ideal = local.truncate() / local.z;
        let [k1, k2, p1, p2, k3] = self.profile.projector.distortion;
        let r2 = ideal.length_squared();
        let (x, y) = (ideal.x, ideal.y);
        ideal = ideal * (1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2)
            + DVec2::new(
                2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            );
        Some(ideal * self.projector_focal_px + self.projector_principal_px)
    }

    pub fn in_field(&self, px: DVec2) -> bool {
        let p = &self.profile.projector;
        let (w, h) = (f64::from(p.width_px), f64::from(p.height_px));
        px.x >= -0.5 && px.y >= -0.5 && px.x < w - 0.5 && px.y < h - 0.5
    }

    /// Returns whether the surface faces the projector at the point that a pixel sees.
    pub fn faces(&self, surface: &(impl Surface + ?Sized), px: DVec2) -> bool {
        surface
            .meet(self.ray(px))
            .is_some_and(|(point, normal)| normal.dot(self.pupil - point) > 0.0)
    }

    /// Returns the side of a pixel's footprint in projector pixels, by central differences; infinite
    /// if the surface ends within the pixel.
    pub fn footprint(&self, surface: &(impl Surface + ?Sized), px: DVec2) -> f64 {
        [DVec2::X, DVec2::Y]
            .into_iter()
            .map(|axis| {
                let ends = [0.5, -0.5].map(|s| self.lit_from(surface, px + axis * s));
                match ends {
                    [Some(a), Some(b)] if (a - b).is_finite() => (a - b).length(),
                    _ => f64::INFINITY,
                }
            })
            .fold(0.0, f64::max)
    }
}
