//! Blooming: charge beyond the full well spills along the column into pixels with free capacity.
//!
//! Janesick, "Scientific Charge-Coupled Devices" (2001), section 4.2: barriers along a column are
//! lower than barriers between columns. Half of the excess therefore goes each way along the column,
//! fills each pixel up to the full well and continues with the remainder. Charge that reaches the
//! image border is drained. Mean charges spill before noise is drawn, since the noise is small
//! compared to a visible excess.

/// Spills the charge of a frame's pixels that exceeds the full well.
///
/// `share`, 0 to 1, is the fraction of the excess that spills. Afterwards no charge is above the
/// full well.
pub(crate) fn spill(electrons: &mut [f32], width: usize, full_well_e: f32, share: f32) {
    if share == 0.0 || !electrons.iter().any(|&e| e > full_well_e) {
        return;
    }
    let excess = |e: &f32| (e - full_well_e).max(0.0) * (0.5 * share);
    let excess: Vec<f32> = electrons.iter().map(excess).collect();
    let mut carried = vec![0.0; width];
    let rows = electrons.chunks_mut(width).zip(excess.chunks(width));
    for (electrons, excess) in rows {
        fill(electrons, excess, full_well_e, &mut carried);
    }
    carried.fill(0.0);
    let rows = electrons.chunks_mut(width).zip(excess.chunks(width));
    for (electrons, excess) in rows.rev() {
        fill(electrons, excess, full_well_e, &mut carried);
    }
}

/// Fills one row with the charge carried over from the adjacent row. Passes the remainder on,
/// together with the row's own excess.
fn fill(electrons: &mut [f32], excess: &[f32], full_well_e: f32, carried: &mut [f32]) {
    for ((e, x), carried) in electrons.iter_mut().zip(excess).zip(carried) {
        let held = e.min(full_well_e);
        let taken = carried.min(full_well_e - held);
        *e = held + taken;
        *carried = *carried - taken + x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 5;
    const ROWS: usize = 101;

    fn bloomed(lit: &[(usize, f32)], share: f32) -> Vec<f32> {
        let mut frame = vec![0.0; WIDTH * ROWS];
        for &(row, e) in lit {
            frame[row * WIDTH + 2] = e;
        }
        spill(&mut frame, WIDTH, 1000.0, share);
        frame
    }

    fn column(frame: &[f32], x: usize) -> Vec<f32> {
        frame.chunks(WIDTH).map(|row| row[x]).collect()
    }

    /// The streak agrees with the closed form: each full well of excess charge lengthens the streak
    /// by one pixel, and half of the streak lies on each side.
    #[test]
    fn a_hot_pixels_streak_is_its_excess_over_the_full_well() {
        let frame = bloomed(&[(50, 8500.0)], 1.0);
        let streak = column(&frame, 2);
        let expected: Vec<f32> = (0..ROWS)
            .map(|r| match r.abs_diff(50) {
                0..=3 => 1000.0,
                4 => 750.0,
                _ => 0.0,
            })
            .collect();
        assert_eq!(streak, expected);
        assert!(
            (0..WIDTH)
                .filter(|&x| x != 2)
                .all(|x| column(&frame, x) == [0.0; ROWS])
        );
    }

    #[test]
    fn charge_is_conserved_up_to_the_share_that_spills() {
        for share in [0.25, 1.0] {
            let lit = [(30, 7300.0), (33, 400.0), (36, 5200.0), (70, 999.0)];
            let frame = bloomed(&lit, share);
            let kept: f32 = lit.iter().map(|l| l.1.min(1000.0)).sum();
            let excess: f32 = lit.iter().map(|l| (l.1 - 1000.0).max(0.0)).sum();
            let total: f32 = frame.iter().sum();
            assert!(
                (total - kept - share * excess).abs() < 0.1,
                "{share}: {total}"
            );
            assert!(frame.iter().all(|&e| e <= 1000.0));
        }
    }

    #[test]
    fn charge_beyond_the_end_of_the_column_is_drained() {
        let total: f32 = bloomed(&[(1, 1e6)], 1.0).iter().sum();
        assert_eq!(total, 1000.0 * ROWS as f32);
    }
}
