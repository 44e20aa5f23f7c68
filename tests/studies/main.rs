//! Compares every study with its snapshot: the quick forms by default, the full forms in a lane of
//! `.ci/run --whole`.

mod faults_matrix;
mod snapshot;
mod zoo;

use phasmid::study::ALL;
use snapshot::quick;

macro_rules! studies {
    ($($test:ident: $name:literal),* $(,)?) => {
        $(#[test]
        fn $test() {
            quick($name);
        })*

        mod whole_forms {
            $(#[test]
            #[ignore = "takes minutes; a lane of `.ci/run --whole` does it"]
            fn $test() {
                crate::snapshot::whole($name);
            })*
        }

        #[test]
        fn every_study_is_compared() {
            let names: Vec<_> = ALL.iter().map(|study| study.name()).collect();
            assert_eq!(names, [$($name),*]);
        }
    };
}

studies! {
    paper: "paper",
    work_precision: "work-precision",
    stability: "stability",
    left_out: "left-out",
    noise: "noise",
    sgrt: "sgrt",
    acceptance: "acceptance",
}
