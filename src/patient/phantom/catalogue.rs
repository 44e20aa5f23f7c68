//! The patients that ship inside the program.

/// Name and text of each patient.
pub(super) const PATIENTS: [(&str, &str); 15] = [
    (
        "p01-woman-mean",
        include_str!("../../../device-profiles/patients/p01-woman-mean.toml"),
    ),
    (
        "p02-man-mean",
        include_str!("../../../device-profiles/patients/p02-man-mean.toml"),
    ),
    (
        "p03-man-slim",
        include_str!("../../../device-profiles/patients/p03-man-slim.toml"),
    ),
    (
        "p04-woman-slim",
        include_str!("../../../device-profiles/patients/p04-woman-slim.toml"),
    ),
    (
        "p05-woman-obese",
        include_str!("../../../device-profiles/patients/p05-woman-obese.toml"),
    ),
    (
        "p06-man-obese",
        include_str!("../../../device-profiles/patients/p06-man-obese.toml"),
    ),
    (
        "p07-child",
        include_str!("../../../device-profiles/patients/p07-child.toml"),
    ),
    (
        "p08-woman-mastectomy",
        include_str!("../../../device-profiles/patients/p08-woman-mastectomy.toml"),
    ),
    (
        "p09-man-tall",
        include_str!("../../../device-profiles/patients/p09-man-tall.toml"),
    ),
    (
        "p10-woman-short",
        include_str!("../../../device-profiles/patients/p10-woman-short.toml"),
    ),
    (
        "p11-man-heavy",
        include_str!("../../../device-profiles/patients/p11-man-heavy.toml"),
    ),
    (
        "p12-woman-full-chest",
        include_str!("../../../device-profiles/patients/p12-woman-full-chest.toml"),
    ),
    (
        "p13-man-shallow",
        include_str!("../../../device-profiles/patients/p13-man-shallow.toml"),
    ),
    (
        "p14-man-deep",
        include_str!("../../../device-profiles/patients/p14-man-deep.toml"),
    ),
    (
        "p15-woman-restless",
        include_str!("../../../device-profiles/patients/p15-woman-restless.toml"),
    ),
];

/// Names of the built-in patients.
pub fn patient_names() -> impl Iterator<Item = &'static str> {
    PATIENTS.iter().map(|(name, _)| *name)
}
