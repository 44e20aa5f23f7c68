// needs: plan, cast, center, slopes, rays, defocus, centers, edges, aperture, sheared, skin_sample, mixed_out
// Renders every pixel with several rays, through several points of the pupil if there is
// depth of field. Twin of `transport/sampled.rs`.
//
// One thread per sample; the samples of a pixel are adjacent in a workgroup. If a pixel's samples
// see one smooth, evenly lit surface, the closed form of its footprint replaces them and is more
// accurate than their mean. Otherwise the samples are kept (`gather`), or the pixel is marked for
// `mixed.wgsl` (`mark`).

// Samples along each side of a pixel: 2, 4 or 8.
override side: u32 = 4u;
override samples: u32 = side * side;

// Tolerance between a sample and the closed form, as a fraction of the footprint's width.
const BENT: f32 = 0.02;

// For each pixel of the workgroup, indexed by its first sample: whether one of its samples
// disagrees with the closed form, and its first head.
var<workgroup> uneven: array<atomic<u32>, GROUP>;
var<workgroup> heads: array<u32, GROUP>;
// Ambient and flickering light of each sample.
var<workgroup> steady: array<vec2f, GROUP>;

// A sample: its pixel and its ray.
struct Sample {
    pixel: u32,
    // Direction of the pixel's centre, with z = 1.
    middle: vec3f,
    ray: Ray,
}

fn sample_ray(pixel: u32, k: u32) -> Sample {
    let at = vec2u(pixel % sampling.size.x, pixel / sampling.size.x);
    let middle = center(at.x, at.y);
    var ray: Ray;
    ray.cell = 1.0 / f32(side);
    ray.row = at.y;
    ray.direction = middle + vec3f(ray_slopes(middle) * sheared(k, side), 0.0);
    if through_pupil {
        ray.origin = pupil_point(at, k);
        ray.direction = through(ray.origin, ray.direction);
    }
    return Sample(pixel, middle, ray);
}

@compute @workgroup_size(64)
fn mark(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = linear(id, groups);
    let used = number / samples < sampling.size.x * sampling.size.y;
    let first = thread - thread % samples;
    atomicStore(&uneven[thread], 0u);
    workgroupBarrier();
    if used {
        let sample = sample_ray(number / samples, number % samples);
        if !agrees(sample, cast_ray(sample.ray)) {
            atomicStore(&uneven[first], 1u);
        }
    }
    workgroupBarrier();
    if used && thread == first && atomicLoad(&uneven[first]) != 0u {
        marks[number / samples] |= UNEVEN;
    }
}

@compute @workgroup_size(64)
fn gather(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = linear(id, groups);
    let pixel = number / samples;
    let used = pixel < sampling.size.x * sampling.size.y;
    let k = number % samples;
    let first = thread - k;
    atomicStore(&uneven[thread], 0u);
    workgroupBarrier();
    var found: Cast;
    var origin = vec3f(0.0);
    if used {
        let sample = sample_ray(pixel, k);
        origin = sample.ray.origin;
        found = cast_ray(sample.ray);
        if !agrees(sample, found) {
            atomicStore(&uneven[first], 1u);
        }
        steady[thread] = select(
            vec2f(0.0),
            vec2f(found.shaded.ambient, found.shaded.flickering),
            found.hit.surface != NO_SURFACE,
        );
    }
    workgroupBarrier();
    let kept = used && atomicLoad(&uneven[first]) != 0u;
    if kept && k == 0u {
        heads[first] = new_heads(samples / MIXED_LANES);
        marks[pixel] |= CREASE;
    }
    workgroupBarrier();
    if !kept {
        return;
    }
    let head = heads[first] + k / MIXED_LANES;
    if k % MIXED_LANES == 0u {
        // Weighted so that the sum over all groups is the mean.
        var sum = vec2f(0.0);
        for (var i = 0u; i < MIXED_LANES; i++) {
            sum += steady[thread + i] / f32(samples);
        }
        write_head(head, pixel, select(0u, samples / MIXED_LANES, k == 0u), sum.x, sum.y);
    }
    var sample = sample_of(found, origin);
    if has_subsurface {
        if head < sampling.room {
            sample.place = into_sample(
                head * MIXED_LANES + k % MIXED_LANES, found.lit, sample.place,
                found.hit.surface, origin + found.shaded.point, found.hit.normal,
            );
        }
    }
    write_sample(head, k % MIXED_LANES, sample);
}

// Whether a sample sees the same smooth surface as its pixel's centre, in the same light, at the
// position predicted by the closed form of the footprint. Twin of `even`.
fn agrees(sample: Sample, found: Cast) -> bool {
    let i = sample.pixel;
    let here = surface[i];
    let lit = (marks[i] & LIT) != 0u;
    if found.lit != lit || (has_lights && found.shaded.lamps != lamp_bits[i]) {
        return false;
    }
    let there = found.hit.surface;
    if there != here && !goes_on(i, here, found.hit) {
        return false;
    }
    if through_pupil && has_albedo_maps && here != NO_SURFACE && varies(object_of(here)) {
        // Depth of field also blurs the albedo, but the closed form averages it over the footprint
        // only.
        return false;
    }
    if !lit {
        return true;
    }
    let point = sample.ray.origin + found.shaded.point;
    let offset = px_step(sample.middle, point.xy / point.z - sample.middle.xy);
    let disc = disc_px(seen[i].w);
    let slope = slopes[i];
    let off = abs(found.shaded.px - place[i] - vec2f(dot(slope.xy, offset), dot(slope.zw, offset)));
    let reach = 1.0 + 2.0 * disc * vec2f(1.0, sampling.pixel_aspect);
    let size = vec2f(dot(abs(slope.xy), reach), dot(abs(slope.zw), reach));
    let bar = BENT * size + 1e-3;
    return (!has_footprint_x || off.x <= bar.x) && (!has_footprint_y || off.y <= bar.y);
}

// Whether the hit triangle continues the centre's mesh without a crease. Twin of `smooth`.
fn goes_on(i: u32, here: u32, hit: Hit) -> bool {
    return here != NO_SURFACE && hit.surface != NO_SURFACE && one_mesh(here, hit.surface)
        && dot(seen[i].xyz, hit.normal) >= COS_CREASE;
}

fn varies(object: u32) -> bool {
    let words = sampling.tables[sampling.varies + object / 64u];
    let word = select(words.x, words.y, (object & 32u) != 0u);
    return (word >> (object % 32u) & 1u) != 0u;
}

fn sample_of(found: Cast, origin: vec3f) -> MixedSample {
    var sample: MixedSample;
    if !found.lit {
        return sample;
    }
    // A sample represents its part of the pixel and of the pupil.
    let part = 1.0 / f32(side);
    let disc = disc_px(found.hit.t);
    sample.place = found.shaded.px;
    sample.slopes_x = widened(found.shaded.footprint.xy, disc) * part;
    sample.slopes_y = widened(found.shaded.footprint.zw, disc) * part;
    sample.projected = found.shaded.projected * f32(MIXED_LANES) / f32(samples);
    if has_projector_defocus {
        sample.blur = blur_px(origin + found.shaded.point);
    }
    return sample;
}
