// needs: mixed_types
// The mixed pixels as passes after the geometry pass read them.

@group(0) @binding(45) var<storage, read> mixed_heads: array<vec4u>;
// Sixteen samples per head, in the order of the heads.
@group(0) @binding(46) var<storage, read> mixed_samples: array<MixedSample>;
// Number of heads, then the number of workgroups of 64 threads, with one thread per head, in three
// dimensions.
@group(0) @binding(47) var<storage, read> mixed_count: array<u32>;
