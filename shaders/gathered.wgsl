// needs: plan, sensor_parameters, fixed
// What a pixel gathers before it is read, twin of Sensor::gather: mean electrons of light by its
// sensitivity, and dark current.

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
