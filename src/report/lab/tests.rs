//! Tests that trials run once, are stored, and give the same document in any order and on any number of
//! jobs.

use super::*;
use phasmid_core::Stop;
use phasmid_core::error::Error;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

static RUNS: AtomicUsize = AtomicUsize::new(0);

/// A study that computes squares of numbers, and may fail at one of them.
struct Squares {
    fails_at: Option<usize>,
}

impl Study for Squares {
    fn name(&self) -> &'static str {
        "squares"
    }

    fn about(&self) -> &'static str {
        "Squares."
    }

    fn columns(&self) -> &'static [&'static str] {
        &["x", "square", "word"]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let fails_at = self.fails_at;
        let one = |i: usize| {
            Trial::new(format!("x={i}"), settings.seed, move |_| {
                if fails_at == Some(i) {
                    return Err(Error::device("no square"));
                }
                RUNS.fetch_add(1, Ordering::Relaxed);
                let row = |x: f64| Row::new().number("x", x).number("square", x * x);
                let x = i as f64 + 0.1;
                Ok(vec![row(x).text("word", "a, \"b\"\nc"), row(-x)])
            })
        };
        Ok((0..20).map(one).collect())
    }

    fn document(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Document> {
        let mut table = Table::new("squares", "Squares", &["x", "square"]);
        for row in &rows.all {
            assert_eq!(row.value("square"), row.value("x").powi(2));
            table.row([row.get("x"), row.get("square")]);
        }
        assert_eq!(rows.of("x=3").next().unwrap().get("word"), "a, \"b\" c");
        let blocks = vec![
            Block::Table(table),
            Block::Checks(vec![Check::at_most("x", 1.0, 2.0)]),
        ];
        let title = "All".to_owned();
        Ok(Document {
            title: "Squares".into(),
            sections: vec![Section { title, blocks }],
        })
    }
}

fn go(fails_at: Option<usize>, path: &std::path::Path, jobs: usize, seed: u64) -> Result<Document> {
    let settings = Settings {
        quick: true,
        seed,
        only: None,
    };
    let around = Surroundings {
        clock: &|| Duration::ZERO,
        jobs,
        revision: "r",
    };
    run(
        &Squares { fails_at },
        path,
        &settings,
        &around,
        &|_, _, _| {},
    )
}

#[test]
fn interrupted_study_resumes() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("study");
    let error = go(Some(7), &path, 1, 5).unwrap_err().to_string();
    assert!(error.contains("trial x=7: no square"), "{error}");
    assert_eq!(RUNS.swap(0, Ordering::Relaxed), 7);
    // Killed in the middle of a trial's rows, and in the middle of a line.
    let rows = path.join("rows.csv");
    let text = std::fs::read_to_string(&rows).unwrap();
    assert_eq!(text.lines().count(), 15);
    let cut = text.rfind("x=6").unwrap();
    std::fs::write(&rows, &text[..cut + 5]).unwrap();
    let first = go(None, &path, 3, 5).unwrap();
    assert_eq!(RUNS.swap(0, Ordering::Relaxed), 14);
    assert_eq!(std::fs::read_to_string(&rows).unwrap().lines().count(), 41);
    // The next run has nothing to do, and the document is the same as that of a single run.
    let again = go(None, &path, 1, 5).unwrap();
    assert_eq!(RUNS.swap(0, Ordering::Relaxed), 0);
    let whole = go(None, &dir.path().join("other"), 1, 5).unwrap();
    for other in [&again, &whole] {
        assert_eq!(first.markdown(true), other.markdown(true));
    }
    assert!(
        first.markdown(true).contains("| 3.1 "),
        "{}",
        first.markdown(true)
    );
    for name in ["tables.md", "report.html", "study.json"] {
        assert!(path.join(name).is_file());
    }
    let studies: [&dyn Study; 1] = [&Squares { fails_at: None }];
    let (document, _, made) = read(&studies, &path).unwrap();
    assert_eq!(document.markdown(true), first.markdown(true));
    assert!(
        made.starts_with("phasmid study squares --quick --seed 5"),
        "{made}"
    );
    // Two runs cannot write to one folder.
    let (held, _) = super::Folder::open(&path).unwrap();
    let lock = std::fs::File::open(held.path().join("study.json")).unwrap();
    lock.lock().unwrap();
    let error = go(None, &path, 1, 5).unwrap_err().to_string();
    assert!(error.contains("runs now"), "{error}");
    drop(lock);
    // The folder of another study, or with other files, is not changed.
    let before = std::fs::read(&rows).unwrap();
    let error = go(None, &path, 1, 6).unwrap_err().to_string();
    assert!(
        error.contains("seed 5") && error.contains("seed 6"),
        "{error}"
    );
    assert_eq!(std::fs::read(&rows).unwrap(), before);
    let stranger = tempfile::tempdir().unwrap();
    std::fs::write(stranger.path().join("thesis.txt"), "mine").unwrap();
    let error = go(None, stranger.path(), 1, 5).unwrap_err().to_string();
    assert!(error.contains("thesis.txt"), "{error}");
    // An error about an invalid row names its line.
    std::fs::write(&rows, text.replace(",1.1,", ",")).unwrap();
    let error = go(None, &path, 1, 5).unwrap_err().to_string();
    assert!(error.contains("rows.csv, line 4"), "{error}");
}

/// A study of six trials. The third one asks the study to end, if it is to be ended.
struct Ends {
    ends: bool,
}

impl Study for Ends {
    fn name(&self) -> &'static str {
        "ends"
    }

    fn about(&self) -> &'static str {
        "Ends early."
    }

    fn columns(&self) -> &'static [&'static str] {
        &["x"]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let ends = self.ends;
        let one = |i: usize| {
            Trial::new(format!("x={i}"), settings.seed, move |context| {
                if ends && i == 2 {
                    // As from another thread, also if it is taken back at once.
                    context.stop.ask();
                    context.stop.reset();
                }
                Ok(vec![Row::new().number("x", i as f64)])
            })
        };
        Ok((0..6).map(one).collect())
    }

    fn document(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Document> {
        assert_eq!(rows.all.len(), 6);
        Ok(Document {
            title: "Ends".into(),
            sections: Vec::new(),
        })
    }
}

#[test]
fn study_ends_when_asked_without_the_trial_in_progress() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("study");
    let settings = Settings {
        quick: true,
        seed: 1,
        only: None,
    };
    let around = Surroundings {
        clock: &|| Duration::ZERO,
        jobs: 1,
        revision: "r",
    };
    let stop = Stop::default();
    let go = |ends| {
        let study = Ends { ends };
        run_with_stop(&study, &path, &settings, &around, &|_, _, _| {}, &stop)
    };
    stop.ask();
    assert!(matches!(go(false), Err(Error::Interrupted)));
    assert!(!path.exists());
    stop.reset();
    assert!(matches!(go(true), Err(Error::Interrupted)));
    let rows = std::fs::read_to_string(path.join("rows.csv")).unwrap();
    // The header and two trials.
    assert_eq!(rows.lines().count(), 3, "{rows}");
    go(false).unwrap();
}
