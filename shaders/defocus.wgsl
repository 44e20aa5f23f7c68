// needs: cast_types
fn dim_border(point: vec3f, shaded: ptr<function, Shaded>) {}
fn blur_px(point: vec3f) -> f32 { return 0.0; }
