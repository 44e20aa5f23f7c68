// needs: plan, optics, cast_types, slopes, materials, there, map, normals, local, lamps
//
// Twin of `apply` in transport/reflect.rs: applies the material of surfaces that have more than a
// constant albedo, and adds the light of lamps.

fn material(ray: Ray, hit: Hit, shaded: ptr<function, Shaded>) {
    let object = object_of(hit.surface);
    let point = ray.origin + (*shaded).point;
    let view = -normalize(ray.direction);
    var local = Local(point, hit.normal, hit.normal, view, materials[object].albedo, NO_LOBE);
    if has_specular {
        if materials[object].lobe != NOTHING {
            local.lobe = materials[object].lobe;
            local.normal = smooth_normal(hit, materials[object], there_of(ray.row, hit), point);
        }
    }
    var slant = 0.0;
    if has_albedo_maps {
        if material_varies(object) {
            let seen = material_over_footprint(ray, hit, point);
            local.albedo *= seen.x;
            slant = seen.y;
        }
    }
    if material_is_white(object) {
        material_finish(local, shaded);
        (*shaded).projected *= 1.0 + slant;
    }
    if has_flicker {
        (*shaded).flickering = (*shaded).ambient * optics[0].ambient_depth;
    }
    if has_lights {
        lamps_add(ray.row, hit.surface, local, shaded);
    }
}

// Factor that vertex colours, textures and ink apply to the albedo, averaged over the ray's part of
// the camera's pixel; and the relative change of the projector's light due to the albedo's gradient
// there, estimated from the halves.
fn material_over_footprint(ray: Ray, hit: Hit, point: vec3f) -> vec2f {
    let slopes = ray_slopes(ray.direction);
    let across = vec3f(slopes[0], 0.0) * hit.t;
    let down = vec3f(slopes[1], 0.0) * hit.t;
    // Projects onto the tangent plane along the ray; seen edge-on, the result is far away.
    let facing = dot(hit.normal, ray.direction);
    let slant = ray.direction / select(facing, -1e-20, abs(facing) < 1e-20);
    let sides = array<vec3f, 2>(
        (across - slant * dot(hit.normal, across)) * ray.cell,
        (down - slant * dot(hit.normal, down)) * ray.cell,
    );
    let middle = point + footprint_shift(sides[0], hit.t) + footprint_shift(sides[1], hit.t);
    let there = there_of(ray.row, hit);
    let way = projector_pupil() - point;
    let falling = way * (3.0 / dot(way, way));
    var mean = 0.0;
    var change = 0.0;
    // The whole patch, then its halves along either side.
    for (var k = 0u; k < 5u; k++) {
        var at = middle;
        var halves = vec2f(1.0);
        var weight = 0.0;
        if k > 0u {
            let which = select(0u, 1u, k > 2u);
            let side = select(sides[0], sides[1], k > 2u);
            let sign = select(-1.0, 1.0, (k & 1u) == 1u);
            at += side * (0.25 * sign);
            halves[which] = 0.5;
            weight = sign * dot(falling, side) / 6.0;
        }
        let seen = material_factor(hit, there, at, sides[0] * halves.x, sides[1] * halves.y);
        if k == 0u {
            mean = seen;
            if !material_is_edge(object_of(hit.surface), mean) {
                break;
            }
        }
        change += weight * seen;
    }
    return vec2f(mean, change / max(mean, 1e-20));
}

// Shift from the point that a pixel's centre sees to the mean point that the pixel sees, along one
// side.
fn footprint_shift(side: vec3f, depth: f32) -> vec3f {
    return side * (clamp(side.z / depth, -0.5, 0.5) / 12.0);
}

// Applies the material to projector and ambient light, which were computed for a white surface.
fn material_finish(local: Local, shaded: ptr<function, Shaded>) {
    if has_specular {
        if local.lobe != NO_LOBE {
            // So far the light has been scaled by the cosine at the facet.
            let light = normalize(projector_pupil() - local.point);
            let cosine = dot(local.facet, light);
            var kept = 0.0;
            if cosine > 0.0 {
                kept = local_reflected(local, light) / cosine;
            }
            let cos_view = dot(local.normal, local.view);
            let even = ggx_under_even_light(local.lobe, local.albedo, cos_view);
            (*shaded).projected *= kept;
            (*shaded).ambient *= even;
            (*shaded).evenly *= even;
            return;
        }
    }
    (*shaded).projected *= local.albedo;
    (*shaded).ambient *= local.albedo;
    (*shaded).evenly *= local.albedo;
}
