// needs: plan, cast_types, world, shade, material, vignetting
// Casts a camera ray and the shadow rays that it needs. Twin of `transport/cast.rs`.

fn cast_ray(ray: Ray) -> Cast {
    var shaded: Shaded;
    let hit = nearest(ray);
    if hit.surface == NO_SURFACE {
        return Cast(hit, shaded, false);
    }
    shaded = shade(ray, hit);
    // No shadow ray for points that the projector cannot light anyway.
    var lit = shaded.reachable;
    if has_shadows {
        if lit {
            lit = !blocked(ray.row, ray.origin + shaded.point, hit.surface);
        }
    }
    if has_albedo_maps || has_specular || has_lights || has_flicker {
        material(ray, hit, &shaded);
    }
    if has_camera_vignetting {
        dim_seen(ray.direction, &shaded);
    }
    return Cast(hit, shaded, lit);
}
