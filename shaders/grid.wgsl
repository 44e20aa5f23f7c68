// needs: plan, maps_in, center_ray, interreflection_types
// Points at which interreflected light is gathered, and the weights with which each pixel uses
// them. Twin of `interreflection/grid.rs`.

@group(0) @binding(95) var<storage, read> interreflection_params: InterreflectionParams;
@group(0) @binding(97) var<storage, read_write> interreflection_points: array<GatherPoint>;
@group(0) @binding(100) var<storage, read_write> interreflection_first: array<u32>;
@group(0) @binding(101) var<storage, read_write> interreflection_shares: array<vec4f>;
// Number of points. It starts as the number of grid points; `shares` adds the additional points.
@group(0) @binding(103) var<storage, read_write> interreflection_count: array<atomic<u32>>;

// Minimum cosine between two normals of one smooth surface within a grid cell: 20 degrees.
const COS_BENT: f32 = 0.9396926207859084;
// Maximum distance of a grid point from a pixel's tangent plane, as a fraction of its distance from
// the pixel's point.
const OFF_PLANE: f32 = 0.2;
// Minimum total weight of the usable grid points; below it they do not represent the pixel.
const LEAST: f32 = 0.2;

// Pixel coordinate of a grid position along one axis.
fn at_place(place: u32, count: u32) -> u32 {
    return min(place * interreflection_params.step, count - 1u);
}

// Writes the points of the grid; the buffer already has room for all points.
@compute @workgroup_size(64)
fn points(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    let p = interreflection_params;
    if i >= p.columns * p.rows {
        return;
    }
    let u = at_place(i % p.columns, p.width);
    let v = at_place(i / p.columns, p.height);
    let pixel = v * p.width + u;
    let is_seen = (marks[pixel] & SEEN) != 0u;
    interreflection_points[i] = GatherPoint(select(NO_PIXEL, pixel, is_seen), 0u, 0u, 0.0);
}

// The grid position before pixel `at`, along an axis with this number of positions.
fn before(at: u32, places: u32) -> u32 {
    return min(at / interreflection_params.step, max(places, 2u) - 2u);
}

// Fraction of the way of `at` from a grid position to the next.
fn onward(at: u32, place: u32, places: u32, count: u32) -> f32 {
    if place + 1u >= places {
        return 0.0;
    }
    let low = at_place(place, count);
    return f32(at - low) / f32(at_place(place + 1u, count) - low);
}

// Whether a pixel sees a smooth continuation of the surface that another pixel sees along `ray`.
// `here` holds the normal and the depth at that other pixel.
fn goes_on_to(here: vec4f, ray: vec3f, pixel: u32) -> bool {
    if (marks[pixel] & SEEN) == 0u {
        return false;
    }
    let there = seen[pixel];
    let way = center_ray(pixel) * there.w - ray * here.w;
    return dot(here.xyz, there.xyz) >= COS_BENT
        && abs(dot(here.xyz, way)) <= OFF_PLANE * length(way);
}

// Computes the weights of the points for each pixel. Pixels that no grid point represents become
// points themselves, in any order.
@compute @workgroup_size(64)
fn shares(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    let p = interreflection_params;
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
            first = atomicAdd(&interreflection_count[0], 1u);
            kept = vec4f(evenly[pixel], 0.0, 0.0, 0.0);
        } else {
            kept *= evenly[pixel] / sum;
        }
    }
    interreflection_first[pixel] = first;
    interreflection_shares[pixel] = kept;
}

// Writes the additional points, which do not belong to the grid.
@compute @workgroup_size(64)
fn alone(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    let p = interreflection_params;
    if pixel >= p.width * p.height {
        return;
    }
    let first = interreflection_first[pixel];
    if first >= p.columns * p.rows {
        interreflection_points[first] = GatherPoint(pixel, 0u, 0u, 0.0);
    }
}
