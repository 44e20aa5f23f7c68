// needs: plan, ggx
//
// Twin of look::Local: a point of a surface as light finds it.

struct Local {
    // In the rig's frame in millimetres.
    point: vec3f,
    // Normal of the surface itself, on the camera's side.
    facet: vec3f,
    // Normal that its light follows.
    normal: vec3f,
    // Unit vector to the camera.
    view: vec3f,
    albedo: f32,
    // NO_MATERIAL where it is Lambertian.
    material: u32,
}

// What the surface makes of 1 W/m^2 from a direction, relative to a white Lambertian one that faces
// it: reflectance times cosine, 0 from behind.
fn local_reflected(local: Local, towards: vec3f) -> f32 {
    if !(dot(local.facet, towards) > 0.0) {
        return 0.0;
    }
    let cosine = max(dot(local.normal, towards), 0.0);
    var reflectance = local.albedo;
    if has_specular {
        if local.material != NO_MATERIAL {
            reflectance = ggx_reflectance(
                local.material, local.albedo, local.normal, towards, local.view);
        }
    }
    return cosine * reflectance;
}
