// needs: plan, optics, cast_types, local, lamp
//
// Twin of `add_lamps` in transport/reflect.rs: light that does not depend on the projected pattern,
// summed into the ambient light.

// Adds the light of all lamps and sets one bit for each lamp that lights the point.
fn lamps_add(row: u32, surface: u32, local: Local, shaded: ptr<function, Shaded>) {
    for (var i = 0u; i < optics[0].lamps; i++) {
        let lamp = lamp_number(i);
        let seen = lamp_seen_from(lamp, local.point);
        let scale = optics[0].electrons_per_irradiance * seen.w;
        let light = scale * local_reflected(local, seen.xyz);
        if !(light > 0.0) {
            continue;
        }
        if has_shadows {
            if lamp_blocked(row, lamp, local.point, surface) {
                continue;
            }
        }
        (*shaded).ambient += light;
        (*shaded).flickering += lamp.depth * light;
        (*shaded).lamps |= 1u << i;
    }
}
