// needs: cast_types
fn dim_seen(direction: vec3f, shaded: ptr<function, Shaded>) {}
fn dim_projected(ideal: vec2f, shaded: ptr<function, Shaded>) {}
