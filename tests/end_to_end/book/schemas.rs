//! The JSON Schemas in `docs/schemas` are generated from the code. `tests/schemas.py` checks files
//! against them.

use phasmid::profile::Document;

#[test]
fn schemas_in_the_repository_are_up_to_date() {
    for document in Document::ALL {
        let page = format!("../schemas/{}.schema.json", document.name());
        super::assert_generated(&page, &document.schema());
    }
}
