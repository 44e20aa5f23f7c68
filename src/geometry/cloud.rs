//! A measured or true surface as points in the rig's frame.

/// Points in millimetres in the rig's frame, with what is known about each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cloud {
    /// Positions in millimetres.
    pub points: Vec<[f32; 3]>,
    /// Unit normals towards the camera, one a point, or none at all.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Brightness of the surface under full projector light, 0 to 1, one a point, or none at all.
    pub intensity: Option<Vec<f32>>,
}
