//! Point clouds of measured or true surfaces.

/// Points in the rig's frame, with optional per-point attributes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cloud {
    /// Positions in millimetres.
    pub points: Vec<[f32; 3]>,
    /// Unit normals that face the camera, one per point, if known.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Brightness of the surface under full projector light, 0 to 1, one per point, if known.
    pub intensity: Option<Vec<f32>>,
    /// Standard deviation along the camera's ray in millimetres, one per point, if known.
    pub sigma_mm: Option<Vec<f32>>,
}

impl Cloud {
    /// Returns the cloud in another frame: points transformed, normals rotated.
    pub fn moved(&self, to_from_cloud: &super::Pose) -> Self {
        let each = |all: &[[f32; 3]], f: &dyn Fn(glam::DVec3) -> glam::DVec3| {
            all.iter()
                .map(|p| {
                    f(glam::DVec3::from_array(p.map(f64::from)))
                        .as_vec3()
                        .to_array()
                })
                .collect()
        };
        Self {
            points: each(&self.points, &|p| to_from_cloud.point(p)),
            normals: self
                .normals
                .as_deref()
                .map(|n| each(n, &|d| to_from_cloud.direction(d))),
            intensity: self.intensity.clone(),
            sigma_mm: self.sigma_mm.clone(),
        }
    }
}
