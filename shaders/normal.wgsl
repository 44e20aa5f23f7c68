// needs: elementary
// Standard normal numbers from uniform words, twin of sensor/normal.rs: the inverse of the
// cumulative distribution by Giles's single-precision erfinv ("Approximating the erfinv function",
// GPU Computing Gems Jade, 2011), evaluated for the smaller tail of the word.

// A uniform number represented by its smaller tail: the probability on that side, in (0, 1/2], and
// the sign bit of the corresponding normal number.
struct Tail {
    probability: f32,
    sign: u32,
}

const SIGN: u32 = 0x80000000u;

fn tail_of_word(word: u32) -> Tail {
    // All bits set in the upper half.
    let upper = bitcast<u32>(bitcast<i32>(word) >> 31u);
    let probability = (f32(word ^ upper) + 0.5) * (1.0 / 4294967296.0);
    return Tail(probability, ~word & SIGN);
}

// Standard normal number of a uniform one. The polynomials give erfinv(x) / x with w = -ln(1 -
// x^2), in w - 2.5 for the central part and in sqrt(w) - 3 for the tail.
fn quantile(tail: Tail) -> f32 {
    let p = tail.probability;
    // 1 - (1 - 2 p)^2 without cancellation.
    let w = -ln(4.0 * p * (1.0 - p));
    var ratio: f32;
    if w < 5.0 {
        let at = w - 2.5;
        ratio = 2.8102264e-8;
        ratio = ratio * at + 3.4327394e-7;
        ratio = ratio * at - 3.5233877e-6;
        ratio = ratio * at - 4.3915065e-6;
        ratio = ratio * at + 2.1858087e-4;
        ratio = ratio * at - 1.253725e-3;
        ratio = ratio * at - 4.1776816e-3;
        ratio = ratio * at + 0.24664073;
        ratio = ratio * at + 1.5014094;
    } else {
        let at = sqrt(w) - 3.0;
        ratio = -2.0021426e-4;
        ratio = ratio * at + 1.0095056e-4;
        ratio = ratio * at + 1.3493432e-3;
        ratio = ratio * at - 3.6734284e-3;
        ratio = ratio * at + 5.7395077e-3;
        ratio = ratio * at - 7.6224613e-3;
        ratio = ratio * at + 9.4388705e-3;
        ratio = ratio * at + 1.001674;
        ratio = ratio * at + 2.8329768;
    }
    let magnitude = ratio * (1.0 - 2.0 * p) * 1.4142135623730951;
    return bitcast<f32>(bitcast<u32>(magnitude) ^ tail.sign);
}
