//! Which settings nobody beats.

/// Whether each of some settings, by cost and error, is on the Pareto front: none other costs no more
/// and errs no more, and less in one of the two. Figures that are none are on no front.
pub fn front(settings: &[[f64; 2]]) -> Vec<bool> {
    let sound = |s: &[f64; 2]| s.iter().all(|v| v.is_finite());
    let beats = |a: &[f64; 2], b: &[f64; 2]| {
        sound(a) && a[0] <= b[0] && a[1] <= b[1] && (a[0] < b[0] || a[1] < b[1])
    };
    let best = |s: &[f64; 2]| sound(s) && !settings.iter().any(|other| beats(other, s));
    settings.iter().map(best).collect()
}

#[cfg(test)]
mod tests {
    use super::front;

    #[test]
    fn a_setting_is_on_the_front_unless_another_beats_it() {
        let settings = [
            [1.0, 9.0],
            [2.0, 3.0],
            [2.0, 4.0],
            [3.0, 3.0],
            [5.0, 1.0],
            [0.5, f64::NAN],
            [6.0, 1.0],
        ];
        let found = front(&settings);
        assert_eq!(found, [true, true, false, false, true, false, false]);
        assert_eq!(front(&[[1.0, 1.0], [1.0, 1.0]]), [true, true], "equals");
        assert!(front(&[]).is_empty());
    }
}
