// needs: plan, cast, rays, defocus, centers, edges, sheared, skin_sample, mixed_out
// Casts the samples of the candidates found by `mixed.wgsl`, and keeps those whose samples do not
// see a single smooth, evenly lit surface. Twin of `sample` and `gather` in
// `transport/mixed.rs`.
//
// Sixteen threads per pixel, one per sample; they exchange data through workgroup memory.

const TILE: u32 = 4u;

@group(0) @binding(48) var<storage, read> candidates: array<u32>;
@group(0) @binding(49) var<storage, read> candidate_count: array<u32, 4>;

var<workgroup> places: array<Place, GROUP>;
// Ambient and flickering light of each sample.
var<workgroup> steady: array<vec2f, GROUP>;
// For each pixel of the workgroup: whether an edge runs through it, and its head.
var<workgroup> broken: array<atomic<u32>, GROUP / MIXED_LANES>;
var<workgroup> heads: array<u32, GROUP / MIXED_LANES>;

@compute @workgroup_size(64)
fn main(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = linear(id, groups) / MIXED_LANES;
    let used = number < candidate_count[0];
    let lane = thread % MIXED_LANES;
    let slot = thread / MIXED_LANES;
    if lane == 0u {
        atomicStore(&broken[slot], 0u);
    }
    var pixel = 0u;
    var found: Cast;
    if used {
        pixel = candidates[number];
        let row = pixel / sampling.size.x;
        let middle = vec2f(vec2u(pixel % sampling.size.x, row));
        let direction = camera_ray(middle + sheared(lane, TILE));
        found = cast_ray(Ray(vec3f(0.0), 1.0 / f32(TILE), direction, row));
        places[thread] = Place(
            found.hit.normal, found.shaded.point.z, direction,
            found.hit.surface, found.shaded.lamps, found.lit,
        );
        steady[thread] = vec2f(found.shaded.ambient, found.shaded.flickering);
    }
    workgroupBarrier();
    // Compares neighbouring samples only, so that a curved surface is not mistaken for an edge.
    if used {
        let here = places[thread];
        var is_edge = lane % TILE + 1u < TILE && edge(here, places[thread + 1u]);
        if !is_edge && lane + TILE < MIXED_LANES {
            is_edge = edge(here, places[thread + TILE]);
        }
        if is_edge {
            atomicStore(&broken[slot], 1u);
        }
    }
    workgroupBarrier();
    let kept = used && atomicLoad(&broken[slot]) != 0u;
    if kept && lane == 0u {
        var sum = vec2f(0.0);
        for (var k = 0u; k < MIXED_LANES; k++) {
            if places[thread + k].surface != NO_SURFACE {
                sum += steady[thread + k] / f32(MIXED_LANES);
            }
        }
        let head = new_heads(1u);
        write_head(head, pixel, 1u, sum.x, sum.y);
        marks[pixel] |= CREASE;
        heads[slot] = head;
    }
    workgroupBarrier();
    if kept {
        var sample = sample_of(found);
        if has_subsurface {
            if heads[slot] < sampling.room {
                sample.place = into_sample(
                    heads[slot] * MIXED_LANES + lane, found.lit, sample.place,
                    found.hit.surface, found.shaded.point, found.hit.normal,
                );
            }
        }
        write_sample(heads[slot], lane, sample);
    }
}

fn sample_of(found: Cast) -> MixedSample {
    var sample: MixedSample;
    if !found.lit {
        return sample;
    }
    // A sample's own footprint is a quarter of the pixel's on each side.
    let part = 1.0 / f32(TILE);
    sample.place = found.shaded.px;
    sample.slopes_x = found.shaded.footprint.xy * part;
    sample.slopes_y = found.shaded.footprint.zw * part;
    sample.projected = found.shaded.projected;
    if has_projector_defocus {
        sample.blur = blur_px(found.shaded.point);
    }
    return sample;
}
