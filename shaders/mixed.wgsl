// needs: plan, center, centers, edges, mixed_out
// Mixed pixels, whose footprint meets more than one surface or a shadow's edge. The centre does not
// represent such a pixel, so the light of 4 x 4 samples is averaged. Twin of
// `transport/mixed.rs`.
//
// Order of the passes: `clear`; `find`, one thread per pixel, which selects candidates that differ
// from one of their eight neighbours; `ready`; `mixed_sample.wgsl`, where samples decide; `close`.

// Candidates per workgroup.
const TOGETHER: u32 = GROUP / MIXED_LANES;

// Pixels whose samples decide.
@group(0) @binding(48) var<storage, read_write> candidates: array<u32>;
// Number of candidates, and the workgroups that they take in three dimensions.
@group(0) @binding(49) var<storage, read_write> candidate_count: array<atomic<u32>, 4>;

@compute @workgroup_size(1)
fn clear() {
    atomicStore(&candidate_count[0], 0u);
    forget_heads();
}

@compute @workgroup_size(64)
fn find(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    if pixel >= sampling.size.x * sampling.size.y {
        return;
    }
    if (marks[pixel] & UNEVEN) != 0u || touches(pixel) {
        candidates[atomicAdd(&candidate_count[0], 1u)] = pixel;
    }
}

// Whether a pixel differs from one of its neighbours. Most pixels share triangle and light with all
// of them, which is checked first with the integer maps.
fn touches(here: u32) -> bool {
    let at = vec2u(here % sampling.size.x, here / sampling.size.x);
    let first = max(at, vec2u(1u)) - 1u;
    let last = min(at + 1u, sampling.size - 1u);
    for (var v = first.y; v <= last.y; v++) {
        for (var u = first.x; u <= last.x; u++) {
            let there = v * sampling.size.x + u;
            var same = surface[there] == surface[here]
                && (marks[there] & LIT) == (marks[here] & LIT);
            if has_lights {
                same = same && lamp_bits[there] == lamp_bits[here];
            }
            if !same && edge(place_of(at, here), place_of(vec2u(u, v), there)) {
                return true;
            }
        }
    }
    return false;
}

fn place_of(at: vec2u, i: u32) -> Place {
    var lamps = 0u;
    if has_lights {
        lamps = lamp_bits[i];
    }
    let lit = (marks[i] & LIT) != 0u;
    return Place(seen[i].xyz, seen[i].w, center(at.x, at.y), surface[i], lamps, lit);
}

@compute @workgroup_size(1)
fn ready() {
    let count = atomicLoad(&candidate_count[0]);
    let grid = grid_of((count + TOGETHER - 1u) / TOGETHER);
    atomicStore(&candidate_count[1], grid.x);
    atomicStore(&candidate_count[2], grid.y);
    atomicStore(&candidate_count[3], 1u);
}

@compute @workgroup_size(1)
fn close() {
    close_heads();
}
