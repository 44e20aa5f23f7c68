// needs: plan, mixed_types, sampling
// The mixed pixels as the passes that find them append them.

@group(0) @binding(45) var<storage, read_write> mixed_heads: array<vec4u>;
@group(0) @binding(46) var<storage, read_write> mixed_samples: array<MixedSample>;
// Heads; groups of 64 threads in three dimensions; the most heads that a pass has wanted.
@group(0) @binding(47) var<storage, read_write> mixed_count: array<atomic<u32>, 5>;

// The first of so many new heads that follow each other. What there is no room for is counted alone:
// whoever runs the pass sees it in the count, and runs it again with more room.
fn new_heads(count: u32) -> u32 {
    return atomicAdd(&mixed_count[0], count);
}

// One group of a pixel; `groups` is how many it has, on the first, 0 on the others.
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

// Takes away the heads of the pass before.
fn forget_heads() {
    atomicStore(&mixed_count[0], 0u);
}

// Says how many threads the heads take.
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

// Groups of threads in rows and columns: one dimension alone ends at 65535.
fn grid_of(groups: u32) -> vec2u {
    let across = min(groups, 65535u);
    return vec2u(across, (groups + max(across, 1u) - 1u) / max(across, 1u));
}
