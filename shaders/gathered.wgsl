// needs: plan, sensor_parameters, fixed
// Charge of a pixel before it is read, twin of Sensor::gather: mean photoelectrons scaled by its
// sensitivity, plus dark current.

fn gathered(electrons: f32, pixel: u32) -> f32 {
    var e = electrons;
    if has_fixed_pattern {
        e *= fixed_pattern[pixel].x;
    }
    if has_dark_current {
        e += sensor_parameters.dark_e;
    }
    return e;
}
