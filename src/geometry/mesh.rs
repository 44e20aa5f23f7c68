//! Triangle meshes.

use glam::DVec3;

/// Triangles over shared vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions in millimetres.
    pub vertices: Vec<DVec3>,
    /// Indices of three vertices each, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}
