// needs: cast_types
fn first_albedo(object: u32) -> f32 { return 0.5; }
fn look(ray: Ray, hit: Hit, shaded: ptr<function, Shaded>) {}
