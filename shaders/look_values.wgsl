// needs: plan
//
// Numbers that look functions look up, one buffer for all of them, as gpu/looks.rs puts them: lamps,
// eight numbers each; the table of soft.wgsl; and, at places that `looks` holds, materials (ggx.wgsl)
// and what is known of triangles' corners: colours, coordinates, normals, places at rest.

@group(0) @binding(32) var<storage, read> look_values: array<f32>;

// Where the lamps begin, 32 at most, and the table of soft.wgsl.
const LAMPS_AT: u32 = 0u;
const SOFT_AT: u32 = 256u;

fn look_value3(at: u32) -> vec3f {
    return vec3f(look_values[at], look_values[at + 1u], look_values[at + 2u]);
}
