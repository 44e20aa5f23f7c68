//! The built-in patients.

/// Name and text of each patient.
pub(super) const PATIENTS: [(&str, &str); 15] = [
    (
        "p01-woman-mean",
        phasmid_device_profiles::PATIENTS_P01_WOMAN_MEAN,
    ),
    (
        "p02-man-mean",
        phasmid_device_profiles::PATIENTS_P02_MAN_MEAN,
    ),
    (
        "p03-man-slim",
        phasmid_device_profiles::PATIENTS_P03_MAN_SLIM,
    ),
    (
        "p04-woman-slim",
        phasmid_device_profiles::PATIENTS_P04_WOMAN_SLIM,
    ),
    (
        "p05-woman-obese",
        phasmid_device_profiles::PATIENTS_P05_WOMAN_OBESE,
    ),
    (
        "p06-man-obese",
        phasmid_device_profiles::PATIENTS_P06_MAN_OBESE,
    ),
    ("p07-child", phasmid_device_profiles::PATIENTS_P07_CHILD),
    (
        "p08-woman-mastectomy",
        phasmid_device_profiles::PATIENTS_P08_WOMAN_MASTECTOMY,
    ),
    (
        "p09-man-tall",
        phasmid_device_profiles::PATIENTS_P09_MAN_TALL,
    ),
    (
        "p10-woman-short",
        phasmid_device_profiles::PATIENTS_P10_WOMAN_SHORT,
    ),
    (
        "p11-man-heavy",
        phasmid_device_profiles::PATIENTS_P11_MAN_HEAVY,
    ),
    (
        "p12-woman-full-chest",
        phasmid_device_profiles::PATIENTS_P12_WOMAN_FULL_CHEST,
    ),
    (
        "p13-man-shallow",
        phasmid_device_profiles::PATIENTS_P13_MAN_SHALLOW,
    ),
    (
        "p14-man-deep",
        phasmid_device_profiles::PATIENTS_P14_MAN_DEEP,
    ),
    (
        "p15-woman-restless",
        phasmid_device_profiles::PATIENTS_P15_WOMAN_RESTLESS,
    ),
];

/// Returns the names of the built-in patients.
pub fn patient_names() -> impl Iterator<Item = &'static str> {
    PATIENTS.iter().map(|(name, _)| *name)
}
