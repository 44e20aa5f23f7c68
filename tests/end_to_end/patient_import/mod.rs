//! `phasmid patient import` as a user runs it: it reproduces the planning folder of a phantom from
//! the phantom's own CT, displacement fields and tumour.

mod dicom;
mod refused;

use glam::DVec3;
use phasmid::host::track::{ModelOptions, Planned, Region};
use phasmid::patient::phantom::{Patient, Phantom};
use phasmid::patient::planning::{Folder, Planning};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::{TempDir, tempdir};

const PATIENT: &str = "p07-child";
const SPACING_MM: f64 = 12.0;

fn patient(arguments: &[String]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .arg("patient")
        .args(arguments)
        .output()
        .unwrap()
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Returns the phantom's planning folder, which is written once for all tests.
fn from() -> PathBuf {
    static MADE: OnceLock<TempDir> = OnceLock::new();
    let folder = MADE.get_or_init(|| {
        let folder = tempdir().unwrap();
        let out = folder.path().join("from").display().to_string();
        let spacing = SPACING_MM.to_string();
        let arguments = [
            "plan",
            PATIENT,
            "--ct",
            "--spacing-mm",
            &spacing,
            "--out",
            &out,
        ];
        let output = patient(&arguments.map(str::to_owned));
        assert!(output.status.success(), "{}", words(&output.stderr));
        folder
    });
    folder.path().join("from")
}

/// Arguments for importing the phantom's own files.
#[derive(Clone)]
struct Import {
    ct: PathBuf,
    tumour: PathBuf,
    phases: Vec<String>,
    more: Vec<String>,
}

impl Import {
    fn new() -> Self {
        let folder = from();
        let field = |percent: u32| format!("dvf_{percent:02}.mha");
        Self {
            ct: folder.join("ct_50.mha"),
            tumour: folder.join("tumour.ply"),
            phases: (0..10)
                .map(|tenth| {
                    format!(
                        "{}={}",
                        10 * tenth,
                        folder.join(field(10 * tenth)).display()
                    )
                })
                .collect(),
            more: Vec::new(),
        }
    }

    fn with(mut self, more: &[&str]) -> Self {
        self.more.extend(more.iter().map(|&word| word.to_owned()));
        self
    }

    fn run(&self, out: &Path) -> Output {
        let mut arguments = vec!["import".to_owned()];
        let mut put = |name: &str, value: String| arguments.extend([name.to_owned(), value]);
        put("--ct", self.ct.display().to_string());
        put("--tumour", self.tumour.display().to_string());
        for phase in &self.phases {
            put("--phase", phase.clone());
        }
        put("--out", out.display().to_string());
        arguments.extend(self.more.iter().cloned());
        patient(&arguments)
    }

    /// Runs the import, which must succeed; returns its output.
    fn made(&self, out: &Path) -> String {
        let output = self.run(out);
        let complaint = words(&output.stderr);
        assert!(output.status.success(), "{complaint}");
        assert!(complaint.is_empty(), "no progress in a pipe: {complaint}");
        words(&output.stdout)
    }

    /// Requires that the import is rejected as a user's mistake, in one line that contains the words
    /// `needles`, and leaves no files behind.
    fn refused(&self, needles: &[&str]) {
        let folder = tempdir().unwrap();
        let out = folder.path().join("planning");
        let output = self.run(&out);
        let complaint = words(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{complaint}");
        assert_eq!(complaint.trim().lines().count(), 1, "{complaint}");
        for needle in needles {
            assert!(complaint.contains(needle), "{needle}\n{complaint}");
        }
        assert!(!out.exists(), "{complaint}");
    }
}

#[test]
fn a_phantom_is_imported_as_it_was_planned() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("again");
    let said = Import::new()
        .with(&["--isocentre", "-0,0,0", "--with-ct"])
        .made(&out);
    for needle in [
        "again: planning.toml, skin.ply, tumour.ply, ct_50.mha, dvf_00.mha to dvf_90.mha\n",
        "voxels of 12.000 x 12.000 x 12.000 mm\n",
        "at -500 HU, ",
        "  isocentre   (",
        "over 10 phases: tumour up to ",
    ] {
        assert!(said.contains(needle), "{needle}\n{said}");
    }
    let [planned, again] = [&from(), &out].map(|path| Planning::load(path).unwrap());
    assert_eq!(again.name, "again");
    assert_eq!(again.reference_percent, 50.0);
    assert_eq!(again.tumour, planned.tumour);
    assert_eq!(again.phases, planned.phases);
    let [a, b] = [&from(), &out].map(|path| Folder::open(path).unwrap().ct().unwrap());
    assert_eq!(a, b);
    // At this threshold, skin over fat is located to within a sixth of a voxel, except near the flat
    // ends of the body.
    let phantom = Phantom::new(&Patient::load(PATIENT).unwrap());
    let between = |v: &&DVec3| (-200.0..150.0).contains(&v.z);
    let mut count = 0;
    for v in again.skin.vertices.iter().filter(between) {
        let off = phantom.outside_skin(*v) / SPACING_MM;
        assert!(off.abs() < 1.0 / 6.0, "{v}: {off} voxels");
        count += 1;
    }
    assert!(count > 1000, "{count}");
    // The tracking models built from both folders must agree.
    let options = ModelOptions::default();
    let [of_plan, of_import] =
        [&planned, &again].map(|p| Planned::new(p, &Region::chest(), &options).unwrap());
    assert!((of_plan.tumour_mm() - of_import.tumour_mm()).length() < 1e-9);
    assert!(of_import.model.components() >= 1);
}

#[test]
fn the_isocentre_is_the_tumours_middle_and_the_reference_at_rest() {
    let folder = tempdir().unwrap();
    let mut import = Import::new().with(&["--name", "p07"]);
    import.phases.remove(5);
    let out = folder.path().join("a/b");
    let said = import.made(&out);
    let note = "phase 50 % has no displacement field";
    assert!(said.contains(note), "{said}");
    let planning = Planning::load(&out).unwrap();
    assert_eq!((planning.name.as_str(), planning.phases.len()), ("p07", 10));
    assert_eq!(planning.phases[5].1.longest_mm(), 0.0);
    let isocentre = Folder::open(&out).unwrap().file().isocentre_mm;
    assert!(isocentre.length() < 0.05, "{isocentre}");
    // An existing planning folder is not overwritten.
    let twice = import.run(&out);
    let complaint = words(&twice.stderr);
    assert_eq!(twice.status.code(), Some(2), "{complaint}");
    assert!(
        complaint.contains("planning.toml, which exists"),
        "{complaint}"
    );
}
