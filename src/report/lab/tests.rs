//! Tests that trials run once, are stored, and give the same document in any order and on any number of
//! jobs.

use super::*;
use phasmid_core::Stop;
use phasmid_core::error::Error;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Number of trials that have run with the seed [`COUNTED`].
static RUNS: AtomicUsize = AtomicUsize::new(0);
const COUNTED: u64 = 5;

/// A study that computes squares of numbers, and may fail at one of them.
struct Squares {
    fails_at: Option<usize>,
}

impl Study for Squares {
    fn name(&self) -> &'static str {
        "squares"
    }

    fn about(&self) -> &'static str {
        "Are these squares?"
    }

    fn title(&self) -> &'static str {
        "Squares"
    }

    fn columns(&self) -> &'static [&'static str] {
        &["x", "square", "word"]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let fails_at = self.fails_at;
        let counted = usize::from(settings.seed == COUNTED);
        let one = |i: usize| {
            Trial::new(format!("x={i}"), settings.seed, move |_| {
                if fails_at == Some(i) {
                    return Err(Error::device("no square"));
                }
                RUNS.fetch_add(counted, Ordering::Relaxed);
                let row = |x: f64| Row::new().number("x", x).number("square", x * x);
                let x = i as f64 + 0.1;
                Ok(vec![row(x).text("word", "a, \"b\"\nc"), row(-x)])
            })
        };
        Ok((0..20).map(one).collect())
    }

    fn sections(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Vec<Section>> {
        let mut table = Table::new("squares", "Squares", &["x", "square"]);
        for row in &rows.all {
            assert_eq!(row.value("square"), row.value("x").powi(2));
            table.row([row.get("x"), row.get("square")]);
        }
        assert_eq!(rows.of("x=3").next().unwrap().get("word"), "a, \"b\" c");
        let empty = Table::new("empty", "No rows", &["x"]);
        let blocks = vec![
            Block::Table(table),
            Block::Table(empty),
            Block::Checks(vec![Check::at_most("x", 1.0, 2.0)]),
        ];
        let title = "All".to_owned();
        Ok(vec![Section { title, blocks }])
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
    // Simulate a run that was killed in the middle of a trial's rows, and one in the middle of a line.
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
    assert!(error.contains("already running"), "{error}");
    drop(lock);
    // A folder of another study, or one that contains other files, is not changed.
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

#[test]
fn report_begins_with_question_and_verdict_and_omits_empty_tables() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("study");
    let mut document = go(None, &path, 1, 7).unwrap();
    let page = |name: &str| std::fs::read_to_string(path.join(name)).unwrap();
    let begins = |text: &str, words: [&str; 3]| {
        let places = words.map(|word| text.find(word).unwrap_or_else(|| panic!("{word}: {text}")));
        assert!(places.is_sorted(), "{text}");
    };
    begins(
        &page("tables.md"),
        ["Are these squares?", "The check passed.", "## All"],
    );
    begins(
        &page("report.html"),
        [
            "Are these squares?",
            "<details><summary><b>The check",
            "<h2>All",
        ],
    );
    for text in [page("tables.md"), page("report.html"), document.screen()] {
        assert!(
            text.contains("Squares") && !text.contains("No rows"),
            "{text}"
        );
    }
    let more = vec![Block::Checks(vec![Check::at_most("y", 3.0, 2.0)])];
    let title = "More".to_owned();
    document.sections.push(Section {
        title,
        blocks: more,
    });
    let text = document.markdown(true);
    begins(&text, ["1 of 2 checks FAILED.", " y |", " x |"]);
    let (folder, _) = Folder::open(&path).unwrap();
    let html = super::page("t", &[(document, &folder, String::new())]).unwrap();
    assert!(html.contains("<details open>"), "{html}");
}

#[test]
fn joined_shards_equal_a_single_run() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let settings = |seed| Settings {
        quick: true,
        seed,
        only: None,
    };
    let around = Surroundings {
        clock: &|| Duration::ZERO,
        jobs: 1,
        revision: "r",
    };
    let study = Squares { fails_at: None };
    let shards = ["1/3", "2/3", "3/3"].map(|text| {
        let shard: Shard = text.parse().unwrap();
        let path = at(&text.replace('/', "-"));
        run_shard(
            &study,
            &path,
            &settings(7),
            &around,
            shard,
            &|_, _, _| {},
            &Stop::default(),
        )
        .unwrap();
        assert!(!path.join("tables.md").exists());
        path
    });
    let lines = |path: &std::path::Path| {
        let rows = std::fs::read_to_string(path.join("rows.csv")).unwrap();
        rows.lines().count()
    };
    // A header, and two rows a trial.
    assert_eq!(shards.each_ref().map(|path| lines(path)), [15, 15, 13]);
    let of_others = join(&study, &at("all"), &settings(6), "r", &shards)
        .unwrap_err()
        .to_string();
    assert!(
        of_others.contains("1-3") && of_others.contains("seed 7"),
        "{of_others}"
    );
    assert!(!at("all").exists());
    // Files of trials are copied, but not the folders of trials that have not ended.
    std::fs::create_dir_all(shards[0].join("files/unfinished")).unwrap();
    std::fs::write(shards[0].join("files/figure.txt"), "3").unwrap();
    // Shards may be joined one after the other.
    for (some, joined) in [(&shards[..2], 14), (&shards[1..], 20)] {
        let found = join(&study, &at("all"), &settings(7), "r", some).unwrap();
        assert_eq!(found, [joined, 20]);
    }
    assert_eq!(lines(&at("all")), 41);
    assert!(at("all").join("files/figure.txt").is_file());
    assert!(!at("all").join("files/unfinished").exists());
    // The remaining trials are run.
    join(&study, &at("some"), &settings(7), "r", &shards[..2]).unwrap();
    go(None, &at("some"), 1, 7).unwrap();
    assert_eq!(lines(&at("some")), 41);
    std::fs::remove_file(shards[2].join("rows.csv")).unwrap();
    let lost = join(&study, &at("lost"), &settings(7), "r", &shards).unwrap_err();
    assert!(lost.to_string().contains("no rows.csv"), "{lost}");
    let whole = go(None, &at("single"), 1, 7).unwrap();
    let joined = go(None, &at("all"), 1, 7).unwrap();
    assert_eq!(joined.markdown(true), whole.markdown(true));
    let rows = |name| std::fs::read_to_string(at(name).join("rows.csv")).unwrap();
    let sorted = |text: String| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    assert_eq!(sorted(rows("all")), sorted(rows("single")));
    for text in ["0/3", "4/3", "1", "1/0", "-1/2", "1/2/3", "1/100000"] {
        assert!(text.parse::<Shard>().is_err(), "{text}");
    }
}

/// A study of six trials. If `ends` is set, the third one asks the study to end.
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

    fn title(&self) -> &'static str {
        "Ends"
    }

    fn columns(&self) -> &'static [&'static str] {
        &["x"]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let ends = self.ends;
        let one = |i: usize| {
            Trial::new(format!("x={i}"), settings.seed, move |context| {
                if ends && i == 2 {
                    // Ask as another thread would. The request counts even if it is withdrawn
                    // immediately.
                    context.stop.ask();
                    context.stop.reset();
                }
                Ok(vec![Row::new().number("x", i as f64)])
            })
        };
        Ok((0..6).map(one).collect())
    }

    fn sections(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Vec<Section>> {
        assert_eq!(rows.all.len(), 6);
        Ok(Vec::new())
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
