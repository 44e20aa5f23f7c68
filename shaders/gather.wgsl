// needs: plan, maps_in, leaving, center_ray, interreflection_types, evenly, lamp, defocus, hemisphere, patch
// Gathers the light at points of surfaces: casts rays over the hemisphere and
// evaluates the light where they end. Twin of `interreflection/gather.rs`. One workgroup per point;
// each thread takes every 64th ray. Rays that end in the projector's light are stored contiguously
// in the order of their directions.

override rays_a_point: u32 = 16u;

@group(0) @binding(95) var<storage, read> interreflection_params: InterreflectionParams;
@group(0) @binding(97) var<storage, read_write> interreflection_points: array<GatherPoint>;
@group(0) @binding(98) var<storage, read_write> interreflection_x: array<vec4f>;
@group(0) @binding(99) var<storage, read_write> interreflection_y: array<vec4f>;
// Irradiance in W/m^2 from lamps at each point, and the amplitude of its flicker.
@group(0) @binding(102) var<storage, read_write> interreflection_lamps: array<vec2f>;

// One bit for each ray kept in the current round.
var<workgroup> mask: array<atomic<u32>, 2>;
// Sums over each thread's rays: projector light under full white, mean lamp light, and amplitude of
// the lamp light's flicker.
var<workgroup> sums: array<vec3f, 64>;

// A point at which light is gathered.
struct GatherPlace {
    at: vec3f,
    normal: vec3f,
    own: u32,
    row: u32,
    axes: mat2x3f,
}

// The contribution of one ray.
struct Brought {
    x: vec4f,
    y: vec4f,
    // Projector light under full white, mean lamp light, and amplitude of the lamp light's flicker.
    light: vec3f,
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let number = group.y * groups.x + group.x;
    var pixel = NO_PIXEL;
    if number < interreflection_params.points {
        pixel = interreflection_points[number].pixel;
    }
    var here: GatherPlace;
    if pixel != NO_PIXEL {
        here = place_of(pixel);
    }
    var kept = 0u;
    var sum = vec3f(0.0);
    for (var first = 0u; first < rays_a_point; first += 64u) {
        let i = first + lane;
        var found = Brought(vec4f(0.0), vec4f(0.0), vec3f(0.0));
        if pixel != NO_PIXEL && i < rays_a_point {
            found = follow(here, i);
        }
        sum += found.light;
        if lane < 2u {
            atomicStore(&mask[lane], 0u);
        }
        workgroupBarrier();
        let is_kept = found.light.x > 0.0;
        if is_kept {
            atomicOr(&mask[lane / 32u], 1u << (lane % 32u));
        }
        workgroupBarrier();
        let low = atomicLoad(&mask[0]);
        let high = atomicLoad(&mask[1]);
        if is_kept {
            let below = (1u << (lane % 32u)) - 1u;
            let before = select(
                countOneBits(low & below), countOneBits(low) + countOneBits(high & below), lane >= 32u,
            );
            let at = number * rays_a_point + kept + before;
            if has_footprint_x {
                interreflection_x[at] = found.x;
            }
            if has_footprint_y {
                interreflection_y[at] = found.y;
            }
        }
        kept += countOneBits(low) + countOneBits(high);
        workgroupBarrier();
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half >>= 1u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u && number < interreflection_params.points {
        interreflection_points[number] = GatherPoint(pixel, number * rays_a_point, kept, sums[0].x);
        if has_lights {
            interreflection_lamps[number] = sums[0].yz;
        }
    }
}

fn place_of(pixel: u32) -> GatherPlace {
    let normal = normalize(seen[pixel].xyz);
    // The rays of neighbouring points are rotated against each other, so that details missed by the
    // few rays differ from point to point. The angle comes from Knuth's multiplicative hash (TAOCP
    // 3, section 6.4).
    return GatherPlace(
        center_ray(pixel) * seen[pixel].w,
        normal,
        surface[pixel],
        pixel / interreflection_params.width,
        interreflection_axes(normal, pixel * 2654435769u),
    );
}

fn follow(here: GatherPlace, number: u32) -> Brought {
    var found = Brought(vec4f(0.0), vec4f(0.0), vec3f(0.0));
    let side = sqrt(3.14159265 / f32(rays_a_point));
    let ray = spoke(number, here.normal, here.axes, side);
    let hit = leaving(here.row, here.at, here.own, ray.direction);
    if hit.surface == NO_SURFACE {
        return found;
    }
    // Projects the patch from the sphere onto the tangent plane, along the ray.
    let slant = ray.direction / dot(hit.normal, ray.direction);
    let across = (ray.sides[0] - slant * dot(hit.normal, ray.sides[0])) * hit.t;
    let down = (ray.sides[1] - slant * dot(hit.normal, ray.sides[1])) * hit.t;
    let at = here.at + ray.direction * hit.t;
    let material = evenly_at(here.row, hit, at, across, down);
    let lit = shown(Patch(at, hit.normal, across, down));
    let part = 1.0 / f32(rays_a_point);
    if lit.irradiance > 0.0 {
        let weight = evenly_share(material, lit.cos) * lit.irradiance * part;
        var dark = !(weight > 0.0);
        if has_shadows && !dark {
            dark = blocked(here.row, at, hit.surface);
        }
        if !dark {
            var x = lit.x;
            var y = lit.y;
            if has_projector_defocus {
                let blur = blur_along(blur_px(at));
                x = vec2f(wide_under(x.x, blur.x), wide_under(x.y, blur.x));
                y = vec2f(wide_under(y.x, blur.y), wide_under(y.y, blur.y));
            }
            found.x = vec4f(lit.px.x, x, weight);
            found.y = vec4f(lit.px.y, y, weight);
            found.light.x = weight;
        }
    }
    if has_lights {
        let lamps = lamps_on(here.row, hit, at, material) * part;
        found.light = vec3f(found.light.x, lamps);
    }
    return found;
}

// Lamp light that a surface reflects, and the amplitude of its flicker.
fn lamps_on(row: u32, hit: Hit, at: vec3f, material: Evenly) -> vec2f {
    var sum = vec2f(0.0);
    for (var i = 0u; i < optics[0].lamps; i++) {
        let lamp = lamp_number(i);
        let from_it = lamp_seen_from(lamp, at);
        let cosine = dot(hit.normal, from_it.xyz);
        if !(cosine > 0.0) {
            continue;
        }
        let thrown = from_it.w * cosine * evenly_share(material, cosine);
        if has_shadows && thrown > 0.0 {
            if lamp_blocked(row, lamp, at, hit.surface) {
                continue;
            }
        }
        sum += vec2f(thrown, thrown * lamp.depth);
    }
    return sum;
}
