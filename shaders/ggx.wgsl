// needs: plan, material_values
//
// Twin of material/ggx.rs: a rough dielectric or metal over a diffuse base. E, the directional
// albedo of the specular lobe, is a table computed on the CPU.

// Layout of a lobe in `material_values`, from its index on: reflectance at normal incidence, alpha,
// coupling, 0, then E at cosines (i / PIECES)^2 for i from 0 to PIECES.
const GGX_PIECES: u32 = 128u;
// Lower limit of the cosine towards the camera, for interpolated normals that face away from it.
const GGX_GRAZING: f32 = 1e-4;
const NO_LOBE: u32 = 0xffffffffu;

// Reflectance of a lobe, given by its index, for light from one direction, relative to a white
// Lambertian surface; all three vectors are unit vectors that point away from the surface.
fn ggx_reflectance(lobe: u32, albedo: f32, normal: vec3f, light: vec3f, view: vec3f) -> f32 {
    let cos_light = dot(normal, light);
    if !(cos_light > 0.0) {
        return 0.0;
    }
    let cos_view = max(dot(normal, view), GGX_GRAZING);
    let entered = (1.0 - ggx_albedo(lobe, cos_light)) * (1.0 - ggx_albedo(lobe, cos_view));
    let diffuse = albedo * entered * material_values[lobe + 2u];
    return diffuse + ggx_lobe(lobe, normal, light, view, cos_light, cos_view);
}

// Reflectance towards the camera under light that is uniform over all directions.
fn ggx_under_even_light(lobe: u32, albedo: f32, cos_view: f32) -> f32 {
    let specular = ggx_albedo(lobe, max(cos_view, GGX_GRAZING));
    return specular + albedo * (1.0 - specular);
}

// pi f_s.
fn ggx_lobe(lobe: u32, n: vec3f, l: vec3f, v: vec3f, cos_light: f32, cos_view: f32) -> f32 {
    let sum = l + v;
    let length2 = dot(sum, sum);
    if !(length2 > 0.0) {
        return 0.0;
    }
    let half_way = sum * inverseSqrt(length2);
    let alpha = material_values[lobe + 1u];
    let a2 = alpha * alpha;
    let cosine = dot(n, half_way);
    // 1 - cos^2 computed from a cross product: it is far smaller than 1 in the highlight of a
    // smooth surface, and the difference would cancel.
    let sine = cross(n, half_way);
    let spread = a2 * cosine * cosine + dot(sine, sine);
    let d = a2 / (spread * spread);
    let smith = ggx_smith(a2, cos_light, cos_view) + ggx_smith(a2, cos_view, cos_light);
    return d * (0.5 / smith) * ggx_fresnel(material_values[lobe], dot(v, half_way));
}

fn ggx_smith(a2: f32, a: f32, b: f32) -> f32 {
    return a * sqrt(a2 + (1.0 - a2) * b * b);
}

fn ggx_fresnel(f0: f32, cosine: f32) -> f32 {
    let less = 1.0 - clamp(cosine, 0.0, 1.0);
    let square = less * less;
    return f0 + (1.0 - f0) * (square * square * less);
}

// E: the fraction of light at this cosine that the lobe reflects.
fn ggx_albedo(lobe: u32, cosine: f32) -> f32 {
    let at = sqrt(clamp(cosine, 0.0, 1.0)) * f32(GGX_PIECES);
    let i = min(u32(at), GGX_PIECES - 1u);
    let from_e = material_values[lobe + 4u + i];
    return from_e + (at - f32(i)) * (material_values[lobe + 5u + i] - from_e);
}
