// needs: elementary, normal
// Poisson numbers of small means by inversion of the distribution, twin of sensor/poisson.rs. Where
// in the last step the uniform number lies is again a uniform number, from which the read noise is
// drawn.

// Means from here on are drawn by noise.wgsl from a normal number.
const POISSON_BELOW: f32 = 32.0;
// Probabilities are in units of 2^-24: those of a word's upper bits are whole numbers of f32.
const POISSON_ONE: f32 = 16777216.0;
// No mean steps further.
const POISSON_STEPS: u32 = 84u;

struct Poisson {
    number: f32,
    // What is left of the word.
    rest: Tail,
}

// The Poisson number of a mean from 0 to POISSON_BELOW.
fn poisson(mean: f32, word: u32) -> Poisson {
    // The uniform number less the probabilities so far: at first positive, in the end negative.
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

// The place of a uniform number that has `low` of its step below it and `high` above.
fn poisson_rest(low: f32, high: f32) -> Tail {
    let lower = low + 0.5 < high;
    let tail = select(high, low + 0.5, lower) / (low + high);
    // In a step narrower than a unit, the half unit is too much.
    return Tail(min(tail, 0.5), select(0u, SIGN, lower));
}

// Rounding leaves the sums of f32 short of one by some 1e-7: the number of a word that lies there.
// The CPU sums in f64 from 0 up. Here the tail is summed from its far end down to the uniform
// number's distance from one, which is exact: terms that rise lose nothing to rounding.
fn poisson_far_tail(mean: f32, word: u32) -> f32 {
    // Of a probability of 2^-25, what lies beyond this is nothing.
    const NOTHING: f32 = 1e-14;
    // Of whole numbers, half a unit each: a compiler may join constants of f32, and lose it.
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
