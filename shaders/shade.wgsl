// needs: plan, optics, cast_types, world, slopes, material, vignetting, defocus
// The projector coordinate that lights a sample, and how much of the light arrives. Twin of
// `exposure/shade.rs`.

// Cosine of 80 degrees.
const COS_80: f32 = 0.17364818;

// Everything except the distortion of the projector's lens.
fn pinhole_body(ray: Ray, hit: Hit, albedo: f32) -> Shaded {
    let lens = optics[0].projector;
    let pupil = projector_pupil() - ray.origin;
    let slopes = ray_slopes(ray.direction);
    let d = ray.direction;
    let n = hit.normal;
    let p = d * hit.t;
    let way = p - pupil;
    let distance2 = dot(way, way);
    let facing = dot(n, d);
    let cos_light = -dot(n, way) * inverseSqrt(distance2);
    let cos_view = -facing * inverseSqrt(dot(d, d));
    var local = vec3f(
        dot(optics[0].projector_x.xyz, way),
        dot(optics[0].projector_y.xyz, way),
        dot(optics[0].projector_z.xyz, way),
    );
    var shaded: Shaded;
    shaded.reachable = local.z > 0.0 && cos_light > 0.0;
    shaded.square = cos_light > COS_80 && cos_view > COS_80;
    if abs(local.z) < 1e-6 {
        local.z = 1e-6;
    }
    let ideal = local.xy / local.z;
    shaded.point = p;
    shaded.px = ideal * lens.focal + lens.principal;
    // Inverse-square law, distances in millimetres.
    shaded.projected = albedo * optics[0].projected * max(cos_light, 0.0) / distance2;
    shaded.ambient = albedo * optics[0].ambient;
    // Chain rule: camera pixel, ray, point on the tangent plane n . p = const, projector's frame,
    // pattern image. The slope is limited for a plane seen edge-on.
    let steep = select(facing, -1e-9, abs(facing) < 1e-9);
    var by: array<vec2f, 2>;
    for (var j = 0u; j < 2u; j++) {
        let dd = vec3f(select(slopes[0], slopes[1], j == 1u), 0.0);
        let dt = -hit.t * dot(n, dd) / steep;
        let dp = dd * hit.t + d * dt;
        let dz = dot(optics[0].projector_z.xyz, dp);
        let dx = vec2f(dot(optics[0].projector_x.xyz, dp), dot(optics[0].projector_y.xyz, dp));
        by[j] = lens.focal * (dx - ideal * dz) / local.z;
    }
    shaded.footprint = vec4f(by[0].x, by[1].x, by[0].y, by[1].y);
    return shaded;
}

// Applies the projector's lens distortion to pinhole coordinates and footprints.
fn distort(shaded: ptr<function, Shaded>) {
    let lens = optics[0].projector;
    let ideal = ((*shaded).px - lens.principal) * lens.scale;
    let place = lens_place(lens, ideal);
    let m = lens_jacobian(lens, ideal);
    let footprint = (*shaded).footprint;
    let by_u = m * (vec2f(footprint.x, footprint.z) * lens.scale) * lens.focal;
    let by_v = m * (vec2f(footprint.y, footprint.w) * lens.scale) * lens.focal;
    (*shaded).footprint = vec4f(by_u.x, by_v.x, by_u.y, by_v.y);
    // A coordinate beyond the fold of the distortion is invalid and outside of the field of view.
    (*shaded).px = select(place.px, vec2f(0.0), place.folded);
    (*shaded).reachable = (*shaded).reachable && !place.folded;
}

// Shades the point that a camera ray has hit.
fn shade(ray: Ray, hit: Hit) -> Shaded {
    let albedo = first_albedo(object_of(hit.surface));
    var shaded = pinhole_body(ray, hit, albedo);
    if has_interreflection {
        shaded.evenly = albedo * optics[0].electrons_per_irradiance;
    }
    if has_projector_vignetting {
        let lens = optics[0].projector;
        dim_projected((shaded.px - lens.principal) * lens.scale, &shaded);
    }
    if has_projector_distortion {
        distort(&shaded);
    }
    shaded.reachable = shaded.reachable && lens_contains(optics[0].projector, shaded.px);
    if has_projector_defocus {
        dim_border(shaded.point, &shaded);
    }
    return shaded;
}
