//! Injects faults and checks the host's response. The results must equal the table in the
//! documentation, and every wrong cloud must be reported, except after faults that no frame shows.

use phasmid::study::faults::{BadDay, Place, Table, frames, markdown, messages, tables};

const DOCUMENTED: &str = include_str!("../../src/study/faults/matrix.md");
/// By default, one fault of this many in a row is tested: a quarter of the time.
const EVERY: usize = 4;

fn wrongs(tables: &[Table]) -> Vec<String> {
    tables.iter().flat_map(Table::wrongs).collect()
}

#[test]
fn every_fourth_fault_has_the_documented_results_and_no_cloud_is_wrong() {
    let kinds = [
        (frames(false), BadDay::of_frames()),
        (messages(), BadDay::of_messages()),
    ];
    for (settings, days) in kinds {
        for day in &days {
            let row = format!("| {} |", day.name);
            assert!(DOCUMENTED.contains(&row), "no row {row}");
        }
        let days: Vec<_> = days.into_iter().step_by(EVERY).collect();
        let places = Place::all(false);
        let table = Table::fill("", &settings.unwrap(), &days, places, &|_| {}).unwrap();
        assert_eq!(table.rows.len(), days.len() * places.len());
        assert_eq!(table.wrongs().collect::<Vec<_>>(), Vec::<String>::new());
        let text = table.to_markdown();
        for line in text.lines().filter(|line| line.starts_with('|')) {
            let is_documented = DOCUMENTED.lines().any(|known| known == line);
            assert!(is_documented, "{RENEW}; the table lacks {line}");
        }
    }
}

const RENEW: &str =
    "`phasmid faults matrix --force --out src/study/faults/matrix.md` renews the table";

#[test]
#[ignore = "a minute or two; a lane of .ci/run --whole"]
fn the_whole_table_is_as_documented() {
    let tables = tables(false, &|_| {}).unwrap();
    assert_eq!(wrongs(&tables), Vec::<String>::new());
    assert_eq!(markdown(&tables), DOCUMENTED, "{RENEW}");
}

#[test]
#[ignore = "ten thousand scans: minutes"]
fn at_no_frame_or_message_is_a_cloud_wrong() {
    let tables = tables(true, &|_| {}).unwrap();
    println!("{}", markdown(&tables));
    assert_eq!(wrongs(&tables), Vec::<String>::new());
}
