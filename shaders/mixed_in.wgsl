// needs: mixed_types
// The mixed pixels as passes after the geometry pass read them.

@group(0) @binding(45) var<storage, read> mixed_heads: array<vec4u>;
// Sixteen a head, in their order.
@group(0) @binding(46) var<storage, read> mixed_samples: array<MixedSample>;
// How many heads there are, then the groups of 64 threads that are a thread a head, in three
// dimensions.
@group(0) @binding(47) var<storage, read> mixed_count: array<u32>;
