//! Patient files.

use super::*;

#[test]
fn impossible_patients_are_refused_by_field() {
    let text = phasmid_device_profiles::PATIENTS_P01_WOMAN_MEAN;
    for (from, to, words) in [
        (
            "mass_kg = 65.0",
            "mass_kg = 180.0",
            "mass_kg: 180 for 1630 mm; expected ",
        ),
        (
            "stature_mm = 1630.0",
            "stature_mm = nan",
            "stature_mm: NaN; expected 1000 to 2100",
        ),
        (
            "period_s = 3.9",
            "period_s = 0.0",
            "breathing.period_s: 0; expected 1.5 to 12",
        ),
        (
            "diameter_mm = 26.0",
            "diameter_mm = 70.0",
            "tumour: a tumour that extends ",
        ),
        (
            "roughness = 0.22",
            "roughness = 0.22\noffset_mm = [0, 0, 60]",
            "another lobe (RightUpper)",
        ),
        (
            "fitzpatrick = 2",
            "fitzpatrick = 7",
            "skin.fitzpatrick: 7; expected 1 to 6",
        ),
        (
            "sex = \"female\"",
            "sex = \"other\"",
            "unknown variant `other`",
        ),
        ("[skin]", "[skin]\ncolour = 3", "unknown field `colour`"),
    ] {
        assert!(text.contains(from), "{from}");
        let found = Patient::parse(&text.replace(from, to), "file.toml").unwrap_err();
        let found = found.to_string();
        assert!(
            found.starts_with("file.toml:") && found.contains(words),
            "{found}"
        );
    }
    // Each value is allowed on its own, but together they compress tissue too much.
    let mad = text
        .replace("diaphragm_mm = 13.0", "diaphragm_mm = 35.0")
        .replace("amplitude = 1.1", "amplitude = 2.0")
        .replace("amplitude_sd = 0.12", "amplitude_sd = 0.3");
    let found = Patient::parse(&mad, "file.toml").unwrap_err().to_string();
    assert!(
        found.contains("breathing: motion that squeezes tissue to"),
        "{found}"
    );
    let absent = Patient::load("p99").unwrap_err();
    assert_eq!(absent.exit_code(), 2);
}

#[test]
fn written_patient_reads_back_equal() {
    for name in patient_names() {
        let patient = Patient::load(name).unwrap();
        assert_eq!(patient.name, name);
        let text = toml::to_string(&patient).unwrap();
        assert_eq!(Patient::parse(&text, "again").unwrap(), patient);
    }
}
