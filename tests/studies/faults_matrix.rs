//! Injects every fault and checks the host's response. The results must equal the table in the
//! documentation, and every wrong cloud must be reported, except after faults that no frame shows.

use phasmid::study::faults::{Table, markdown, tables};

fn wrongs(tables: &[Table]) -> Vec<String> {
    tables.iter().flat_map(Table::wrongs).collect()
}

#[test]
fn the_table_is_as_documented_and_no_cell_is_wrong() {
    let tables = tables(false, &|_| {}).unwrap();
    assert_eq!(wrongs(&tables), Vec::<String>::new());
    assert_eq!(
        markdown(&tables),
        include_str!("../../src/study/faults/matrix.md"),
        "`phasmid faults matrix --force --out src/study/faults/matrix.md` renews the table"
    );
}

#[test]
#[ignore = "ten thousand scans: minutes"]
fn at_no_frame_or_message_is_a_cloud_wrong() {
    let tables = tables(true, &|_| {}).unwrap();
    println!("{}", markdown(&tables));
    assert_eq!(wrongs(&tables), Vec::<String>::new());
}
