// needs: plan, material_values, world
//
// Twin of `Lamp` in exposure/lamps.rs: a light source in the scene other than the projector.

// A position in the rig's frame and a radiant intensity in W/sr, or the direction towards a distant
// light and its irradiance in W/m^2.
struct Lamp {
    at: vec3f,
    power: f32,
    is_point: bool,
    // Amplitude of its flicker relative to its mean.
    depth: f32,
}

// One of `optics[0].lamps`.
fn lamp_number(i: u32) -> Lamp {
    let at = LAMPS_AT + 8u * i;
    return Lamp(
        material_value3(at), material_values[at + 3u], material_values[at + 4u] != 0.0, material_values[at + 5u]);
}

// Direction to a lamp from a point (xyz), and the irradiance in W/m^2 of a surface there that faces
// the lamp (w).
fn lamp_seen_from(lamp: Lamp, point: vec3f) -> vec4f {
    if !lamp.is_point {
        return vec4f(lamp.at, lamp.power);
    }
    let way = lamp.at - point;
    let distance2 = dot(way, way);
    // At the lamp itself the direction is undefined and the irradiance infinite; use no light.
    if !(distance2 > 0.0) {
        return vec4f(0.0);
    }
    return vec4f(way * inverseSqrt(distance2), lamp.power * 1e6 / distance2);
}

// Whether an object blocks the way between a lamp and a point of a surface.
fn lamp_blocked(row: u32, lamp: Lamp, point: vec3f, surface: u32) -> bool {
    if lamp.is_point {
        return blocked_from(row, lamp.at, point, surface);
    }
    return blocked_along(row, lamp.at, point, surface);
}
