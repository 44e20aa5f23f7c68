//! Every fault against the host: the table in the documentation is what comes of it, and a cloud is
//! wrong without a word nowhere but where that is known.

use phasma::study::faults::{Table, markdown, tables};

/// Faults of single pixels and rows of one frame whose errors are near the noise: the host does not
/// tell all of them yet.
const KNOWN: [&str; 3] = ["rows missing, 1", "bits flipped, 64", "bits flipped, 4096"];

fn unknown(tables: &[Table]) -> Vec<String> {
    let wrongs = tables.iter().flat_map(Table::wrongs);
    let known = |words: &String| KNOWN.iter().any(|fault| words.contains(fault));
    wrongs.filter(|words| !known(words)).collect()
}

#[test]
fn the_table_is_as_documented_and_no_other_cell_is_wrong() {
    let tables = tables(false, &|_| {}).unwrap();
    assert_eq!(unknown(&tables), Vec::<String>::new());
    assert_eq!(
        markdown(&tables),
        include_str!("../src/study/faults/matrix.md"),
        "`phasma faults matrix --out src/study/faults/matrix.md` renews the table"
    );
}

#[test]
#[ignore = "three thousand scans: minutes"]
fn at_no_other_frame_or_message_is_a_cloud_wrong() {
    let tables = tables(true, &|_| {}).unwrap();
    println!("{}", markdown(&tables));
    assert_eq!(unknown(&tables), Vec::<String>::new());
}
