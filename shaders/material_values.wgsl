// needs: plan
//
// Numbers that the material functions look up, in one buffer, laid out by gpu/materials.rs: lamps,
// eight numbers each; the table of soft.wgsl; and, at indices stored in `materials`, materials
// (ggx.wgsl) and attributes of triangle corners: colours, texture coordinates, normals, positions
// at rest.

@group(0) @binding(32) var<storage, read> material_values: array<f32>;

// Start of the lamps, of which there are at most 32.
const LAMPS_AT: u32 = 0u;
// Start of the table of soft.wgsl.
const SOFT_AT: u32 = 256u;

fn material_value3(at: u32) -> vec3f {
    return vec3f(material_values[at], material_values[at + 1u], material_values[at + 2u]);
}
