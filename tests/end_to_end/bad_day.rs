//! The fault schedule shipped as an example.

use phasmid::profile::faults::Schedule;
use std::path::Path;

#[test]
fn example_schedule_holds_the_documented_faults() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let schedule = Schedule::read(&root.join("device-profiles/faults/bad-day.toml")).unwrap();
    let what: Vec<_> = schedule
        .fault
        .iter()
        .map(|fault| fault.what.name())
        .collect();
    let wanted = ["torn", "dropped", "late-reply", "disconnect", "reset"];
    assert_eq!((schedule.seed, &what[..]), (7, &wanted[..]));
}
