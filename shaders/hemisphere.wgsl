// Cosine-weighted directions over a hemisphere, each with the patch that it represents. Twin of
// `interreflection/hemisphere.rs`; the points of the disc are computed on the CPU.

// For each direction: its position in the unit disc below the hemisphere, its height above the
// disc, and the divisor of the height of its patch's sides.
@group(0) @binding(96) var<storage, read> interreflection_disc: array<vec4f>;

// A direction, and the sides of its patch of the unit sphere.
struct Spoke {
    direction: vec3f,
    sides: mat2x3f,
}

// Cosine and sine of a fraction of a turn, in units of 2^-32.
fn of_turn(turn: u32) -> vec2f {
    // Remainder from the nearest quarter turn; at most an eighth.
    let quarter = (turn + 0x20000000u) >> 30u;
    let rest = f32(bitcast<i32>(turn - (quarter << 30u)));
    let a = rest * 1.4629180792671596e-9;
    let b = a * a;
    // Taylor's series, to 1e-8.
    let c = 1.0 + b * (-0.5 + b * (4.1666667e-2 + b * (-1.3888889e-3 + b * 2.4801587e-5)));
    let s = a * (1.0 + b * (-1.6666667e-1 + b * (8.3333333e-3 + b * (-1.9841270e-4 + b * 2.7557319e-6))));
    switch quarter {
        case 0u: { return vec2f(c, s); }
        case 1u: { return vec2f(-s, c); }
        case 2u: { return vec2f(-c, -s); }
        default: { return vec2f(s, -c); }
    }
}

// Two unit vectors perpendicular to a unit normal and to each other (Duff et al., "Building an
// Orthonormal Basis, Revisited", JCGT 6(1), 2017), rotated about the normal by `turn`.
fn interreflection_axes(normal: vec3f, turn: u32) -> mat2x3f {
    let sign = select(1.0, -1.0, normal.z < 0.0);
    let a = -1.0 / (sign + normal.z);
    let c = normal.x * normal.y * a;
    let t = vec3f(1.0 + sign * normal.x * normal.x * a, sign * c, -sign * normal.x);
    let b = vec3f(c, sign + normal.y * normal.y * a, -normal.y);
    let by = of_turn(turn);
    return mat2x3f(t * by.x + b * by.y, b * by.x - t * by.y);
}

// A direction above a surface; `side` is the side of the square of the disc that each direction
// represents.
fn spoke(number: u32, normal: vec3f, axes: mat2x3f, side: f32) -> Spoke {
    let p = interreflection_disc[number];
    let fall = normal / p.w;
    let sides = mat2x3f((axes[0] - fall * p.x) * side, (axes[1] - fall * p.y) * side);
    return Spoke(axes[0] * p.x + axes[1] * p.y + normal * p.z, sides);
}
