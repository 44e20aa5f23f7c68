use crate::led::{Emission, Model, Source};
use phasmid_profile::{Droop, Led};

const MS: u64 = 1_000_000;

fn model() -> Model {
    let droop = |time_constant_s, fraction| Droop {
        time_constant_s,
        fraction,
    };
    Model::new(&Led {
        rise_us: 4.0,
        droop: vec![droop(0.5, 0.06), droop(90.0, 0.15)],
    })
}

fn close(found: f64, exact: f64) {
    assert!(
        (found - exact).abs() <= 2e-14 * exact.abs(),
        "{found} {exact}"
    );
}

#[test]
fn drive_history_is_kept_in_device_time() {
    let model = model();
    let mut source = Source::new(model.clone());
    source.drive(10 * MS, 1.0);
    source.drive(15 * MS, 0.4);
    source.drive(18 * MS, 0.0);
    let all = source.emission(9 * MS);
    let at_10 = model.off();
    let at_15 = model.after(&at_10, 1.0, 5e6);
    let at_18 = model.after(&at_15, 0.4, 3e6);
    assert_eq!(all.mean(9 * MS, 10 * MS), 0.0);
    close(all.mean(10 * MS, 15 * MS), model.mean(&at_10, 1.0, 5e6));
    close(all.mean(15 * MS, 18 * MS), model.mean(&at_15, 0.4, 3e6));
    close(all.mean(18 * MS, 30 * MS), model.mean(&at_18, 0.0, 12e6));
    close(all.mean(15 * MS, 15 * MS), model.light(&at_15));
    let parts = [(9, 10, 1.0), (10, 15, 5.0), (15, 18, 3.0), (18, 30, 12.0)];
    let sum: f64 = parts
        .iter()
        .map(|(a, b, w)| w * all.mean(a * MS, b * MS))
        .sum();
    close(all.mean(9 * MS, 30 * MS), sum / 21.0);
    // If an interval is split anywhere, its parts have the same total light.
    let total = |emission: &Emission, from, to| emission.mean(from, to) * (to - from) as f64;
    for cut in [9 * MS + 1, 10 * MS + 777, 14_999_999, 17 * MS, 29 * MS] {
        let cut_sum = total(&all, 9 * MS, cut) + total(&all, cut, 30 * MS);
        close(cut_sum, total(&all, 9 * MS, 30 * MS));
    }
    // The light of later exposures does not depend on earlier queries.
    for start in [11, 14, 16, 19] {
        let later = source.emission(start * MS);
        close(later.mean(20 * MS, 25 * MS), all.mean(20 * MS, 25 * MS));
        close(later.mean(19 * MS, 19 * MS), all.mean(19 * MS, 19 * MS));
    }
}

#[test]
fn emission_does_not_depend_on_order_of_notifications() {
    let mut told_late = Source::new(model());
    told_late.drive(0, 0.9);
    told_late.drive(7 * MS, 0.5);
    told_late.open(2 * MS, false);
    told_late.open(5 * MS, true);
    told_late.open(9 * MS, false);
    let mut plain = Source::new(model());
    for (from_ms, level) in [(0, 0.9), (2, 0.0), (5, 0.9), (7, 0.5), (9, 0.0)] {
        plain.drive(from_ms * MS, level);
    }
    let (one, other) = (told_late.emission(MS), plain.emission(MS));
    for (from, to) in [(1, 2), (1, 8), (3, 4), (6, 20), (9, 10)] {
        close(one.mean(from * MS, to * MS), other.mean(from * MS, to * MS));
    }
    // A planned change may be replaced by an earlier one.
    told_late.open(20 * MS, true);
    told_late.open(30 * MS, false);
    told_late.open(25 * MS, false);
    let cut = told_late.emission(12 * MS);
    assert!(cut.mean(20 * MS, 25 * MS) > 0.4 && cut.mean(26 * MS, 30 * MS) < 1e-12);
}

#[test]
fn commands_without_end_take_no_memory() {
    let mut source = Source::new(model());
    for i in 0..100_000u64 {
        source.drive(i * 1000, f64::from(i % 2 == 0));
        source.open(i * 1000 + 500, i % 3 != 0);
    }
    let emission = source.emission(0);
    assert!(format!("{emission:?}").len() < 5_000_000);
    let mean = emission.mean(0, 100 * MS);
    assert!(mean > 0.0 && mean < 1.0);
    let mut same = Source::new(model());
    (0..1000).for_each(|i| same.drive(i * MS, 1.0));
    assert!(format!("{same:?}").len() < 1000, "no change is no change");
}
