// needs: interreflection_types
// Interreflections as the exposure pass reads them. Twin of `exposure/indirect_map.rs`.

@group(0) @binding(95) var<storage, read> interreflection_params: InterreflectionParams;
@group(0) @binding(97) var<storage, read> interreflection_points: array<GatherPoint>;
@group(0) @binding(98) var<storage, read> interreflection_x: array<vec4f>;
@group(0) @binding(99) var<storage, read> interreflection_y: array<vec4f>;
// For each pixel, the first of the four points that it is interpolated from, and the electrons per
// second for 1 W/m^2 at each of them.
@group(0) @binding(100) var<storage, read> interreflection_first: array<u32>;
@group(0) @binding(101) var<storage, read> interreflection_shares: array<vec4f>;

// The four points that a pixel is interpolated from. Points with zero weight may not exist.
fn interreflection_corners(pixel: u32) -> vec4u {
    let first = interreflection_first[pixel];
    let below = first + interreflection_params.columns;
    return vec4u(first, first + 1u, below, below + 1u);
}
