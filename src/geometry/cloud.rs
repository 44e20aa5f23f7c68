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
    /// Removes the points at exactly (0, 0, 0), with which many scanners mark invalid pixels, and
    /// returns their number. A surface cannot lie at the origin of a rig.
    pub fn drop_origin(&mut self) -> usize {
        let before = self.points.len();
        let keep: Vec<bool> = self.points.iter().map(|p| *p != [0.0; 3]).collect();
        fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
            let mut kept = keep.iter();
            values.retain(|_| *kept.next().unwrap_or(&true));
        }
        retain(&mut self.points, &keep);
        let normals = self.normals.iter_mut();
        normals.for_each(|values| retain(values, &keep));
        let scalars = self.intensity.iter_mut().chain(&mut self.sigma_mm);
        scalars.for_each(|values| retain(values, &keep));
        before - self.points.len()
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_at_the_origin_are_dropped_with_their_attributes() {
        let mut cloud = Cloud {
            points: vec![[0.0; 3], [1.0; 3], [-0.0, 0.0, 0.0], [0.0, 0.0, 2.0]],
            normals: Some(vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]]),
            intensity: None,
            sigma_mm: Some(vec![0.0, 1.0, 2.0, 3.0]),
        };
        assert_eq!(cloud.drop_origin(), 2);
        assert_eq!(cloud.points, [[1.0; 3], [0.0, 0.0, 2.0]]);
        assert_eq!(cloud.normals.unwrap(), [[1.0; 3], [3.0; 3]]);
        assert_eq!(cloud.sigma_mm.unwrap(), [1.0, 3.0]);
    }
}
