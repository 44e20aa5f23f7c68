// needs: plan, materials, map, ggx
//
// Twin of `Evenly` in interreflection/patch.rs: the light that a surface reflects, treated as if it
// were reflected equally in all directions.

// The material of a patch.
struct Evenly {
    albedo: f32,
    // NO_LOBE if it is Lambertian.
    lobe: u32,
}

// Material of a patch around the point of a hit, in the rig's frame, with its albedo averaged over
// the patch.
fn evenly_at(row: u32, hit: Hit, point: vec3f, across: vec3f, down: vec3f) -> Evenly {
    let object = object_of(hit.surface);
    var albedo = materials[object].albedo;
    var lobe = NO_LOBE;
    if has_albedo_maps {
        if material_varies(object) {
            albedo *= material_factor(hit, there_of(row, hit), point, across, down);
        }
    }
    if has_specular {
        lobe = materials[object].lobe;
    }
    return Evenly(albedo, lobe);
}

// Fraction of light, incident at this cosine to the normal, that the diffuse base and the specular
// lobe reflect together.
fn evenly_share(evenly: Evenly, cosine: f32) -> f32 {
    if has_specular {
        if evenly.lobe != NO_LOBE {
            return ggx_under_even_light(evenly.lobe, evenly.albedo, cosine);
        }
    }
    return evenly.albedo;
}
