//! `phasma patient import` as a user runs it: a phantom's planning folder, made again of its own CT,
//! fields and tumour; the CT as DICOM too; and what does not fit, one message each.

use glam::DVec3;
use phasma::geometry::{Mesh, ply};
use phasma::host::track::{ModelOptions, Planned, Region};
use phasma::patient::metaimage::{Packing, read_volume, write_field, write_volume};
use phasma::patient::phantom::{Patient, Phantom};
use phasma::patient::planning::{Folder, Planning};
use phasma::patient::volume::{Field, Grid, Volume, Voxels};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::{TempDir, tempdir};

const PATIENT: &str = "p07-child";
const SPACING_MM: f64 = 12.0;

fn patient(arguments: &[String]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasma"))
        .arg("patient")
        .args(arguments)
        .output()
        .unwrap()
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What the phantom's planning wrote, once for all tests.
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

/// Arguments of an import of the phantom's own files.
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

    /// Runs it well; what it says.
    fn made(&self, out: &Path) -> String {
        let output = self.run(out);
        let complaint = words(&output.stderr);
        assert!(output.status.success(), "{complaint}");
        assert!(complaint.is_empty(), "a pipe hears nothing: {complaint}");
        words(&output.stdout)
    }

    /// Refused as a user's mistake, in one line with these words, and nothing is left behind.
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
    // Skin over fat shows to within a sixth of a voxel at this level, away from the flat ends.
    let phantom = Phantom::new(&Patient::load(PATIENT).unwrap());
    let between = |v: &&DVec3| (-200.0..150.0).contains(&v.z);
    let mut count = 0;
    for v in again.skin.vertices.iter().filter(between) {
        let off = phantom.outside_skin(*v) / SPACING_MM;
        assert!(off.abs() < 1.0 / 6.0, "{v}: {off} voxels");
        count += 1;
    }
    assert!(count > 1000, "{count}");
    // What tracking makes of it.
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
    let note = "phase 50 % has no field of its own";
    assert!(said.contains(note), "{said}");
    let planning = Planning::load(&out).unwrap();
    assert_eq!((planning.name.as_str(), planning.phases.len()), ("p07", 10));
    assert_eq!(planning.phases[5].1.longest_mm(), 0.0);
    let isocentre = Folder::open(&out).unwrap().file().isocentre_mm;
    assert!(isocentre.length() < 0.05, "{isocentre}");
    // A planning is not written over.
    let twice = import.run(&out);
    let complaint = words(&twice.stderr);
    assert_eq!(twice.status.code(), Some(2), "{complaint}");
    assert!(
        complaint.contains("planning.toml is there already"),
        "{complaint}"
    );
}

/// A CT's slices as DICOM, explicit VR, whole numbers from -1024.
fn dicom(ct: &Volume, series: &str, description: &str, folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let grid = ct.grid();
    let [ni, nj, nk] = grid.size;
    let (spacing, origin) = (grid.spacing_mm, grid.origin_mm);
    for k in 0..nk {
        let mut elements: BTreeMap<(u16, u16), (&str, Vec<u8>)> = BTreeMap::new();
        let z = origin.z + spacing.z * k as f64;
        for (tag, text) in [
            ((0x08, 0x16), "1.2.840.10008.5.1.4.1.1.2"),
            ((0x08, 0x103E), description),
            ((0x10, 0x20), "P07"),
            ((0x20, 0x0E), series),
            ((0x20, 0x32), &format!("{}\\{}\\{z}", origin.x, origin.y)),
            ((0x20, 0x37), "1\\0\\0\\0\\1\\0"),
            ((0x20, 0x52), "1.9"),
            ((0x28, 0x30), &format!("{}\\{}", spacing.y, spacing.x)),
            ((0x28, 0x1052), "-1024"),
            ((0x28, 0x1053), "1"),
        ] {
            elements.insert(tag, ("LO", text.as_bytes().to_vec()));
        }
        for (element, number) in [
            (0x02, 1),
            (0x10, nj as u16),
            (0x11, ni as u16),
            (0x100, 16),
            (0x101, 12),
            (0x102, 11),
            (0x103, 0),
        ] {
            elements.insert((0x28, element), ("US", number.to_le_bytes().to_vec()));
        }
        let pixels = (0..ni * nj).flat_map(|n| {
            let stored = ct.voxels().get(n + ni * nj * k) + 1024.0;
            (stored as u16).to_le_bytes()
        });
        elements.insert((0x7FE0, 0x10), ("OW", pixels.collect()));
        let mut bytes = vec![0; 128];
        bytes.extend(b"DICM");
        let meta = (&(2, 0x10), &("UI", b"1.2.840.10008.1.2.1\0".to_vec()));
        for (&(group, element), (vr, value)) in [meta].into_iter().chain(&elements) {
            bytes.extend([group.to_le_bytes(), element.to_le_bytes()].concat());
            bytes.extend(vr.as_bytes());
            let length = value.len() + value.len() % 2;
            if *vr == "OW" {
                bytes.extend([0, 0]);
                bytes.extend((length as u32).to_le_bytes());
            } else {
                bytes.extend((length as u16).to_le_bytes());
            }
            bytes.extend(value);
            bytes.resize(bytes.len() + value.len() % 2, b' ');
        }
        fs::write(folder.join(format!("{k:03}.dcm")), bytes).unwrap();
    }
}

#[test]
fn a_series_of_dicom_shows_the_same_skin() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let ct = read_volume(&from().join("ct_50.mha")).unwrap();
    Import::new().made(&path("image"));
    let mut import = Import::new();
    import.ct = path("series");
    dicom(&ct, "1.5.1", "Thorax", &import.ct);
    let said = import.made(&path("one"));
    assert!(said.contains("  ct          `Thorax` (1.5.1): "), "{said}");
    let skin = |name: &str| Mesh::read(&path(name).join("skin.ply")).unwrap();
    let (image, one) = (skin("image"), skin("one"));
    assert_eq!(image.triangles, one.triangles);
    for (a, b) in image.vertices.iter().zip(&one.vertices) {
        assert!((*a - *b).length() < 1e-6, "{a} {b}");
    }
    // A slice missing; images of another series among them.
    fs::remove_file(import.ct.join("020.dcm")).unwrap();
    import.refused(&[
        "021.dcm: a slice missing between it and ",
        "019.dcm; allowed: a slice each 12.000 mm",
    ]);
    dicom(&ct, "1.5.2", "Thorax", &path("other"));
    fs::rename(path("other").join("020.dcm"), import.ct.join("020.dcm")).unwrap();
    import.refused(&[
        "series: series without a phase: `Thorax` (1.5.1), ",
        "`Thorax` (1.5.2), 1 images; allowed: one series",
    ]);

    // Of a 4D-CT the reference phase is taken, whatever else lies there.
    let four = path("four");
    let far = Voxels::I16(vec![-1000; ct.voxels().len()]);
    let air = Volume::new(*ct.grid(), far, "air").unwrap();
    dicom(&air, "1.6.0", "Gated, 0.0%", &four.join("a"));
    dicom(&ct, "1.6.5", "Gated, 50.0%", &four.join("b"));
    dicom(&air, "1.6.9", "Average", &four.join("c"));
    import.ct = four;
    let said = import.made(&path("of-four"));
    assert!(said.contains("`Gated, 50.0%` (1.6.5): "), "{said}");
    assert_eq!(skin("of-four").triangles, image.triangles);
    let import = import.with(&["--reference-phase", "30"]);
    import.refused(&[
        "four: phases 0, 50 %, and `Average` (1.6.9), ",
        "allowed: phase 30 %",
    ]);
}

#[test]
fn what_does_not_fit_is_named() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let ct = read_volume(&from().join("ct_50.mha")).unwrap();
    let grid = *ct.grid();
    let field = |grid: Grid, name: &str| {
        let field = Field::of(grid, |_| DVec3::ZERO, "dvf").unwrap();
        write_field(&path(name), &field, Packing::Plain).unwrap();
        path(name).display().to_string()
    };

    // Words that are none.
    let mut import = Import::new();
    import.phases[2] = "twenty=dvf_20.mha".to_owned();
    import.refused(&["--phase twenty=dvf_20.mha: no phase; allowed: PERCENT=FILE"]);
    Import::new()
        .with(&["--isocentre", "1,2"])
        .refused(&["--isocentre 1,2: no point; allowed: X,Y,Z in millimetres"]);
    Import::new()
        .with(&["--isocentre", "0,-900,0"])
        .refused(&["isocentre: (0, -900, 0) mm; allowed: a point in the CT's LPS"]);
    Import::new()
        .with(&["--name", "J. Doe"])
        .refused(&["patient's name: \"J. Doe\"; allowed: 1 to 64 letters"]);

    // Fields that do not match each other, the CT or the body.
    let mut coarse = grid;
    coarse.spacing_mm = DVec3::splat(12.5);
    let mut import = Import::new();
    import.phases[3] = format!("30={}", field(coarse, "coarse.mha"));
    import.refused(&[
        "phase 30 %: ",
        "coarse.mha: a spacing of (12.5, 12.5, 12.5); allowed: as ",
    ]);
    let mut import = Import::new();
    import.phases.push(import.phases[3].clone());
    import.refused(&[
        "phase 30 %: ",
        "dvf_30.mha: a second field; allowed: one field a phase",
    ]);
    let of_all = |grid: Grid, name: &str| {
        let mut import = Import::new();
        let file = field(grid, name);
        import.phases = vec![format!("0={file}"), format!("50={file}")];
        import
    };
    of_all(grid.shifted(DVec3::new(0.0, 0.0, 900.0)), "elsewhere.mha").refused(&[
        "ct_50.mha: a CT of (",
        "allowed: one around the fields, which have (",
    ]);
    let mut short = grid;
    short.size[2] /= 2;
    of_all(short, "short.mha").refused(&[
        "short.mha: skin: ",
        " vertices outside of the fields, (",
        "allowed: vertices within (",
    ]);
    Import::new().with(&["--reference-phase", "0"]).refused(&[
        "dvf_00.mha: displacements of up to ",
        "none above 0.5 mm from the reference phase to itself",
    ]);

    // A CT that is none.
    let mut import = Import::new();
    import.ct = path("absent.mha");
    import.refused(&["absent.mha: "]);
    import.ct = from().join("dvf_00.mha");
    import.refused(&["dvf_00.mha: 3 numbers a voxel; allowed: one number a voxel"]);
    let raised = (0..ct.voxels().len()).map(|n| ct.voxels().get(n) as i16 + 1000);
    let raised = Volume::new(grid, Voxels::I16(raised.collect()), "ct").unwrap();
    import.ct = path("raised.mha");
    write_volume(&import.ct, &raised, Packing::Zlib).unwrap();
    import.refused(&["raised.mha: 100 % of the voxels at -500 or more; allowed: Hounsfield units"]);
    Import::new()
        .with(&["--skin-hu", "5000"])
        .refused(&["ct_50.mha: skin: no voxel of 5000 or more; allowed: a level up to "]);

    // A tumour that is not closed, or not in the body.
    let mesh = Mesh::read(&from().join("tumour.ply")).unwrap();
    let mut import = Import::new();
    import.tumour = path("tumour.ply");
    let mut open = mesh.clone();
    open.triangles.pop();
    ply::write_mesh(&import.tumour, &open).unwrap();
    import.refused(&["tumour.ply: an open edge between vertices"]);
    let mut beside = mesh;
    beside.vertices.iter_mut().for_each(|v| v.y -= 300.0);
    ply::write_mesh(&import.tumour, &beside).unwrap();
    import.refused(&[
        "tumour.ply: ",
        " vertices outside of the skin, (",
        "allowed: a tumour in the body",
    ]);
    import.tumour = path("tumour.step");
    import.refused(&["tumour.step: extension `step`; allowed: .stl, .obj or .ply, or a mask"]);
}
