// The lens model: a pinhole with OpenCV's five Brown-Conrady coefficients. Twin of
// `geometry/lens.rs`.

struct Lens {
    // Focal lengths, then the principal point, in pixels.
    focal: vec2f,
    principal: vec2f,
    // Columns and rows of the image.
    size: vec2f,
    // One over the focal lengths.
    scale: vec2f,
    // k1, k2, p1, p2.
    k: vec4f,
    k3: f32,
    // Largest length of an ideal image point before the distortion polynomial folds over.
    unfolded: f32,
    distorted: u32,
    spare: u32,
}

// Pixel of an ideal image point. It is invalid if `folded` is set: the distortion polynomial folds
// over closer to the axis than the image point.
struct LensPlace {
    px: vec2f,
    folded: bool,
}

// Distorted image point of an ideal one, both in units of the focal length.
fn lens_distort(lens: Lens, p: vec2f) -> vec2f {
    let r2 = dot(p, p);
    let radial = r2 * (lens.k.x + r2 * (lens.k.y + r2 * lens.k3));
    let cross = 2.0 * p.x * p.y;
    let aside = vec2f(
        lens.k.z * cross + lens.k.w * (r2 + 2.0 * p.x * p.x),
        lens.k.z * (r2 + 2.0 * p.y * p.y) + lens.k.w * cross,
    );
    // The small terms are added first, so that the distortion keeps its precision.
    return p + (p * radial + aside);
}

// Jacobian of `lens_distort`; column j holds the derivatives by coordinate j.
fn lens_jacobian(lens: Lens, p: vec2f) -> mat2x2f {
    let r2 = dot(p, p);
    let radial = 1.0 + r2 * (lens.k.x + r2 * (lens.k.y + r2 * lens.k3));
    let slope = 2.0 * (lens.k.x + r2 * (2.0 * lens.k.y + r2 * 3.0 * lens.k3));
    let off = p.x * p.y * slope + 2.0 * (lens.k.z * p.x + lens.k.w * p.y);
    return mat2x2f(
        radial + p.x * p.x * slope + 2.0 * lens.k.z * p.y + 6.0 * lens.k.w * p.x,
        off,
        off,
        radial + p.y * p.y * slope + 6.0 * lens.k.z * p.y + 2.0 * lens.k.w * p.x,
    );
}

fn lens_inverse(m: mat2x2f) -> mat2x2f {
    let one = 1.0 / (m[0].x * m[1].y - m[1].x * m[0].y);
    return mat2x2f(m[1].y * one, -m[0].y * one, -m[1].x * one, m[0].x * one);
}

// Whether a pixel coordinate lies in the image.
fn lens_contains(lens: Lens, px: vec2f) -> bool {
    return all(px >= vec2f(-0.5)) && all(px < lens.size - 0.5);
}

// Pixel of an ideal image point, through a distorted lens.
fn lens_place(lens: Lens, ideal: vec2f) -> LensPlace {
    let px = lens.focal * lens_distort(lens, ideal) + lens.principal;
    let beyond = dot(ideal, ideal) > lens.unfolded * lens.unfolded;
    return LensPlace(px, beyond && lens_contains(lens, px));
}

// Ideal image point of a pixel: the direction, with z = 1, of the ray through it. Newton's method;
// profiles whose distortion folds over within the image are rejected.
fn lens_ray(lens: Lens, px: vec2f) -> vec2f {
    let wanted = (px - lens.principal) * lens.scale;
    if lens.distorted == 0u {
        return wanted;
    }
    var p = wanted;
    if dot(p, p) >= lens.unfolded * lens.unfolded {
        p *= 0.5 * lens.unfolded / length(p);
    }
    for (var i = 0; i < 30; i++) {
        var step = lens_inverse(lens_jacobian(lens, p)) * (lens_distort(lens, p) - wanted);
        // Never step across a fold.
        for (var j = 0; j < 20 && length(p - step) >= lens.unfolded; j++) {
            step *= 0.5;
        }
        p -= step;
        // The next step would be at the level of rounding.
        if dot(step, step) <= 1e-9 * (1.0 + dot(p, p)) {
            let last = lens_inverse(lens_jacobian(lens, p)) * (lens_distort(lens, p) - wanted);
            return p - last;
        }
    }
    return p;
}
