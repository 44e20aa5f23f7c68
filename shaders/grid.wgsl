// needs: plan, maps_in, center_ray, bounce_types
// Where bounced light is gathered, and what each pixel takes from there. Twin of `bounce/grid.rs`.

@group(0) @binding(95) var<storage, read> bounce_params: BounceParams;
@group(0) @binding(97) var<storage, read_write> bounce_points: array<BouncePoint>;
@group(0) @binding(100) var<storage, read_write> bounce_first: array<u32>;
@group(0) @binding(101) var<storage, read_write> bounce_shares: array<vec4f>;
// How many points there are, those of the grid first: at the start those alone.
@group(0) @binding(103) var<storage, read_write> bounce_count: array<atomic<u32>>;

// Normals of one smooth surface are closer than 20 degrees over a cell of the grid.
const COS_BENT: f32 = 0.9396926207859084;
// A point of the grid is this part of its distance off a pixel's tangent plane at most.
const OFF_PLANE: f32 = 0.2;
// Points that share less than this of a cell do not stand for a pixel in it.
const LEAST: f32 = 0.2;

// The pixel of a place of the grid along one axis.
fn at_place(place: u32, count: u32) -> u32 {
    return min(place * bounce_params.step, count - 1u);
}

// The points of the grid, once there is room for all points.
@compute @workgroup_size(64)
fn points(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    let p = bounce_params;
    if i >= p.columns * p.rows {
        return;
    }
    let u = at_place(i % p.columns, p.width);
    let v = at_place(i / p.columns, p.height);
    let pixel = v * p.width + u;
    let is_seen = (marks[pixel] & SEEN) != 0u;
    bounce_points[i] = BouncePoint(select(NO_PIXEL, pixel, is_seen), 0u, 0u, 0.0);
}

// The place before `at` of `places` along an axis of `count` pixels.
fn before(at: u32, places: u32) -> u32 {
    return min(at / bounce_params.step, max(places, 2u) - 2u);
}

// How far `at` is on its way to the next place.
fn onward(at: u32, place: u32, places: u32, count: u32) -> f32 {
    if place + 1u >= places {
        return 0.0;
    }
    let low = at_place(place, count);
    return f32(at - low) / f32(at_place(place + 1u, count) - low);
}

// Whether one smooth surface goes on from a pixel to another.
fn goes_on_to(here: vec4f, ray: vec3f, pixel: u32) -> bool {
    if (marks[pixel] & SEEN) == 0u {
        return false;
    }
    let there = seen[pixel];
    let way = center_ray(pixel) * there.w - ray * here.w;
    return dot(here.xyz, there.xyz) >= COS_BENT
        && abs(dot(here.xyz, way)) <= OFF_PLANE * length(way);
}

// The shares of the pixels. Those that no point of the grid stands for become points themselves, in
// any order.
@compute @workgroup_size(64)
fn shares(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    let p = bounce_params;
    if pixel >= p.width * p.height {
        return;
    }
    let u = pixel % p.width;
    let v = pixel / p.width;
    let i = before(u, p.columns);
    let j = before(v, p.rows);
    var first = j * p.columns + i;
    var kept = vec4f(0.0);
    if (marks[pixel] & SEEN) != 0u {
        let right = onward(u, i, p.columns, p.width);
        let down = onward(v, j, p.rows, p.height);
        let even = vec4f(
            (1.0 - right) * (1.0 - down), right * (1.0 - down), (1.0 - right) * down, right * down,
        );
        let left_u = at_place(i, p.width);
        let right_u = at_place(i + 1u, p.width);
        let upper = at_place(j, p.height) * p.width;
        let lower = at_place(j + 1u, p.height) * p.width;
        let here = seen[pixel];
        let ray = center_ray(pixel);
        if even.x > 0.0 && goes_on_to(here, ray, upper + left_u) {
            kept.x = even.x;
        }
        if even.y > 0.0 && goes_on_to(here, ray, upper + right_u) {
            kept.y = even.y;
        }
        if even.z > 0.0 && goes_on_to(here, ray, lower + left_u) {
            kept.z = even.z;
        }
        if even.w > 0.0 && goes_on_to(here, ray, lower + right_u) {
            kept.w = even.w;
        }
        let sum = kept.x + kept.y + kept.z + kept.w;
        if sum < LEAST {
            first = atomicAdd(&bounce_count[0], 1u);
            kept = vec4f(evenly[pixel], 0.0, 0.0, 0.0);
        } else {
            kept *= evenly[pixel] / sum;
        }
    }
    bounce_first[pixel] = first;
    bounce_shares[pixel] = kept;
}

// The points beside the grid.
@compute @workgroup_size(64)
fn alone(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    let p = bounce_params;
    if pixel >= p.width * p.height {
        return;
    }
    let first = bounce_first[pixel];
    if first >= p.columns * p.rows {
        bounce_points[first] = BouncePoint(pixel, 0u, 0u, 0.0);
    }
}
