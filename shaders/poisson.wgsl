// needs: elementary, normal
// Poisson numbers with small means by inversion of the cumulative distribution, twin of
// sensor/poisson.rs. The position of the uniform number within the last step is again uniform; the
// read noise is drawn from it.

// For means from here on, noise.wgsl uses a normal number instead.
const POISSON_BELOW: f32 = 32.0;
// Probabilities are in units of 2^-24: a uniform number from the upper 24 bits of a word is then an
// integer that f32 represents exactly.
const POISSON_ONE: f32 = 16777216.0;
// Maximum number of steps for any mean.
const POISSON_STEPS: u32 = 84u;

struct Poisson {
    number: f32,
    // Remainder of the word, for the read noise.
    rest: Tail,
}

// Poisson number for a mean from 0 to POISSON_BELOW.
fn poisson(mean: f32, word: u32) -> Poisson {
    // The uniform number minus the probabilities so far: positive at first, negative in the end.
    var low = f32(word >> 8u);
    var probability = exp_negative(mean) * POISSON_ONE;
    for (var n = 0u; n < POISSON_STEPS; n++) {
        let left = low - probability;
        if left < 0.0 {
            return Poisson(f32(n), poisson_rest(low, -left));
        }
        low = left;
        probability *= mean * (1.0 / f32(n + 1u));
    }
    return Poisson(poisson_far_tail(mean, word), Tail(0.5, ~word & SIGN));
}

// Position of a uniform number within its step, with `low` of the step below it and `high` above.
fn poisson_rest(low: f32, high: f32) -> Tail {
    let lower = low + 0.5 < high;
    let tail = select(high, low + 0.5, lower) / (low + high);
    // In a step narrower than one unit, adding half a unit can exceed 1/2.
    return Tail(min(tail, 0.5), select(0u, SIGN, lower));
}

// Rounding leaves the f32 sums about 1e-7 short of one; this function handles words in that gap.
// The CPU sums in f64 from 0 up. Here the tail is summed from its far end until it reaches the
// uniform number's distance from one. This is exact, since increasing terms lose nothing to
// rounding.
fn poisson_far_tail(mean: f32, word: u32) -> f32 {
    // Terms below this are negligible compared with a probability of 2^-25.
    const NOTHING: f32 = 1e-14;
    // Computed with integers, in half units: a compiler may combine f32 constants and lose the half
    // unit.
    let distance = f32(0x1ffffffu - 2u * (word >> 8u)) * (0.5 / POISSON_ONE);
    var probability = exp_negative(mean);
    var n = 0.0;
    while n < f32(POISSON_STEPS) && (n < mean || probability > NOTHING) {
        n += 1.0;
        probability *= mean / n;
    }
    var beyond = probability;
    while n > 0.0 && beyond <= distance {
        n -= 1.0;
        probability *= (n + 1.0) / mean;
        beyond += probability;
    }
    return n;
}
