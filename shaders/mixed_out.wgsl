// needs: plan, mixed_types, sampling
// The mixed pixels, as appended by the passes that find them.

@group(0) @binding(45) var<storage, read_write> mixed_heads: array<vec4u>;
@group(0) @binding(46) var<storage, read_write> mixed_samples: array<MixedSample>;
// Number of heads; workgroups of 64 threads in three dimensions; the largest number of heads that a
// pass has requested.
@group(0) @binding(47) var<storage, read_write> mixed_count: array<atomic<u32>, 5>;

// Reserves `count` consecutive heads and returns the first. Heads beyond the buffer's room are only
// counted: whoever runs the pass reads the count and runs it again with more room.
fn new_heads(count: u32) -> u32 {
    return atomicAdd(&mixed_count[0], count);
}

// Writes one group of a pixel; `groups` is the pixel's number of groups for the first head and 0
// for the others.
fn write_head(head: u32, pixel: u32, groups: u32, ambient: f32, flickering: f32) {
    if head < sampling.room {
        mixed_heads[head] =
            vec4u(pixel, groups, bitcast<u32>(ambient), bitcast<u32>(flickering));
    }
}

fn write_sample(head: u32, k: u32, sample: MixedSample) {
    if head < sampling.room {
        mixed_samples[head * MIXED_LANES + k] = sample;
    }
}

// Discards the heads of the previous pass.
fn forget_heads() {
    atomicStore(&mixed_count[0], 0u);
}

// Writes the number of workgroups that the heads need.
fn close_heads() {
    let wanted = atomicLoad(&mixed_count[0]);
    let heads = min(wanted, sampling.room);
    let grid = grid_of((heads + GROUP - 1u) / GROUP);
    atomicStore(&mixed_count[0], heads);
    atomicStore(&mixed_count[1], grid.x);
    atomicStore(&mixed_count[2], grid.y);
    atomicStore(&mixed_count[3], 1u);
    atomicMax(&mixed_count[4], wanted);
}

// Workgroups in rows and columns: one dimension is limited to 65535.
fn grid_of(groups: u32) -> vec2u {
    let across = min(groups, 65535u);
    return vec2u(across, (groups + max(across, 1u) - 1u) / max(across, 1u));
}
