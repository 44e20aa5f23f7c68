//! Ground truth: what the scene really is, pixel by pixel. It leaves the device on a channel that
//! no physical scanner has, never on the control port.

/// Truth of a still scene over the camera's pixels, row by row; NaN where there is none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Truth {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// z of the surface point at the pixel's centre, in the camera's frame, in millimetres.
    pub depth_mm: Vec<f32>,
    /// Projector column that lights the point, whether or not it is in its field or in shadow.
    pub projector_x: Vec<f32>,
    /// Projector row that lights the point.
    pub projector_y: Vec<f32>,
    /// What is so at the pixel: a sum of the `Truth::*` flags.
    pub flags: Vec<u8>,
    /// Noise-free signal in digital numbers, black level included, averaged over the fringes.
    pub mean_dn: Vec<f32>,
    /// Noise-free modulation B of the finest fringes in digital numbers.
    pub modulation_dn: Vec<f32>,
}

impl Truth {
    /// The camera's ray meets a surface.
    pub const SEEN: u8 = 1;
    /// The point is in the projector's field and out of shadow.
    pub const LIT: u8 = 2;
    /// Both rays strike the surface at less than 80 degrees from its normal.
    pub const SQUARE: u8 = 4;
    /// The pixel's footprint meets more than one facet, object or shadow.
    pub const CREASE: u8 = 8;

    /// The float maps by name, in the order of the truth channel.
    pub fn maps(&self) -> [(&'static str, &[f32]); 5] {
        [
            ("depth_mm", &self.depth_mm),
            ("projector_x", &self.projector_x),
            ("projector_y", &self.projector_y),
            ("mean_dn", &self.mean_dn),
            ("modulation_dn", &self.modulation_dn),
        ]
    }
}
