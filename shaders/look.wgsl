// needs: plan, optics, cast_types, slopes, looks, there, map, normals, local, lamps
//
// Twin of look/mod.rs (apply): reflects the light of surfaces that are more than one albedo, and
// adds the lamps'.

fn look(ray: Ray, hit: Hit, shaded: ptr<function, Shaded>) {
    let object = object_of(hit.surface);
    let point = ray.origin + (*shaded).point;
    let view = -normalize(ray.direction);
    var local = Local(point, hit.normal, hit.normal, view, looks[object].albedo, NO_MATERIAL);
    if has_specular {
        if looks[object].material != NOTHING {
            local.material = looks[object].material;
            local.normal = smooth_normal(hit, looks[object], there_of(ray.row, hit), point);
        }
    }
    if has_albedo_maps {
        if look_varies(object) {
            local.albedo *= look_over_footprint(ray, hit, point);
        }
    }
    if look_is_white(object) {
        look_finish(local, shaded);
    }
    if has_flicker {
        (*shaded).flickering = (*shaded).ambient * optics[0].ambient_depth;
    }
    if has_lights {
        lamps_add(ray.row, hit.surface, local, shaded);
    }
}

// What vertex colours and textures make of an albedo, over the ray's part of the camera's pixel.
fn look_over_footprint(ray: Ray, hit: Hit, point: vec3f) -> f32 {
    let slopes = ray_slopes(ray.direction);
    let across = vec3f(slopes[0], 0.0) * hit.t;
    let down = vec3f(slopes[1], 0.0) * hit.t;
    // Onto the tangent plane, along the ray; edge-on, that is far.
    let facing = dot(hit.normal, ray.direction);
    let slant = ray.direction / select(facing, -1e-20, abs(facing) < 1e-20);
    let side = (across - slant * dot(hit.normal, across)) * ray.cell;
    let other = (down - slant * dot(hit.normal, down)) * ray.cell;
    let middle = point + footprint_shift(side, hit.t) + footprint_shift(other, hit.t);
    return look_factor(hit, there_of(ray.row, hit), middle, side, other);
}

// From what a pixel's centre sees to the mean of what the pixel sees, along one side.
fn footprint_shift(side: vec3f, depth: f32) -> vec3f {
    return side * (clamp(side.z / depth, -0.5, 0.5) / 12.0);
}

// What a surface makes of the projector's and of ambient light, where it has been lit as white.
fn look_finish(local: Local, shaded: ptr<function, Shaded>) {
    if has_specular {
        if local.material != NO_MATERIAL {
            // Lit by the cosine at the facet so far.
            let light = normalize(projector_pupil() - local.point);
            let cosine = dot(local.facet, light);
            var kept = 0.0;
            if cosine > 0.0 {
                kept = local_reflected(local, light) / cosine;
            }
            let cos_view = dot(local.normal, local.view);
            let even = ggx_under_even_light(local.material, local.albedo, cos_view);
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
