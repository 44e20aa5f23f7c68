// needs: plan, ggx
//
// Twin of `Local` in transport/reflect.rs: a surface point with the quantities that its
// illumination needs.

struct Local {
    // Position in the rig's frame in millimetres.
    point: vec3f,
    // Geometric normal of the surface, on the camera's side.
    facet: vec3f,
    // Shading normal.
    normal: vec3f,
    // Unit vector to the camera.
    view: vec3f,
    albedo: f32,
    // NO_LOBE if it is Lambertian.
    lobe: u32,
}

// Reflected light for 1 W/m^2 from a direction, relative to a white Lambertian surface that faces
// that direction: reflectance times cosine; 0 for light from behind.
fn local_reflected(local: Local, towards: vec3f) -> f32 {
    if !(dot(local.facet, towards) > 0.0) {
        return 0.0;
    }
    let cosine = max(dot(local.normal, towards), 0.0);
    var reflectance = local.albedo;
    if has_specular {
        if local.lobe != NO_LOBE {
            reflectance = ggx_reflectance(
                local.lobe, local.albedo, local.normal, towards, local.view);
        }
    }
    return cosine * reflectance;
}
