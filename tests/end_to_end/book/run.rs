//! Runs the commands of each page, in the order in which a reader meets them.

use super::{blocks, pages};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// In a new folder, writes the page's `file=NAME` blocks and runs its `sh` blocks, including blocks
/// marked with a word of `more`. Returns the folder and the output.
fn run(page: &str, more: &[&str]) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let mut script = String::from(
        // The script replaces `cargo run --release --` by the program that cargo has built for this
        // test.
        "set -eu\n\
         cargo() { [ \"$1 $2 $3\" = 'run --release --' ]; shift 3; phasmid \"$@\"; }\n\
         trap 'kill $(jobs -p) 2> /dev/null || true; wait' EXIT\n",
    );
    for block in blocks(Path::new(page)) {
        if let Some(name) = block.file() {
            std::fs::write(folder.path().join(name), &block.text).unwrap();
        }
        let marks = &block.info[1.min(block.info.len())..];
        if block.language() == "sh" && marks.iter().all(|mark| more.contains(&mark.as_str())) {
            // Scanning a whole breath takes two minutes, so only two scans are made.
            script += &block.text.replace("--scans 43", "--scans 2");
        }
    }
    let program = Path::new(env!("CARGO_BIN_EXE_phasmid")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let output = Command::new("bash")
        .args(["-c", &script])
        .env("PATH", path)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let out = String::from_utf8_lossy(&output.stdout).into_owned();
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{page}:\n{out}\n{err}");
    (folder, out)
}

/// Defines a test for each page with commands, and a constant that lists the pages.
macro_rules! pages_run {
    ($($name:ident: $page:literal, [$($file:literal),*];)*) => {
        const RUN: &[&str] = &[$($page),*];
        $(
            #[test]
            fn $name() {
                let (folder, out) = run($page, &[]);
                for file in [$($file),*] as [&str; _] {
                    assert!(folder.path().join(file).is_file(), "{}: no {file}\n{out}", $page);
                }
                assert!(!folder.path().join("run/device.json").exists(), "serve has cleaned up");
            }
        )*
    };
}

// For each page: name of the test, page, and files that the page's commands create.
pages_run! {
    readme: "README.md", ["phasmid-demo/overview.png", "scan/cloud.ply", "decoded/cloud.ply", "mine/summary.json"];
    install: "docs/src/start/install.md", [];
    first_scan: "docs/src/start/first-scan.md", ["phasmid-demo/summary.json", "decoded/cloud.ply"];
    links: "docs/src/start/links.md", ["scan/cloud.ply"];
    driver: "docs/src/guides/driver.md", ["scan/frame_00.png", "scan/cloud.ply"];
    several: "docs/src/guides/several.md", ["room-left/cloud.ply"];
    kernel_camera: "docs/src/guides/kernel-camera.md", [];
    usb: "docs/src/guides/usb.md", ["usb-scan/cloud.ply"];
    dialects: "docs/src/guides/dialects.md", ["own.toml"];
    faults: "docs/src/guides/faults.md", [];
    console: "docs/src/guides/console.md", ["serve.log"];
    recordings: "docs/src/guides/recordings.md", ["rec-scan/cloud.ply", "replay-scan/cloud.ply"];
    own_scanner: "docs/src/guides/own-scanner.md", [];
    own_scene: "docs/src/guides/own-scene.md", [];
    own_decoder: "docs/src/guides/own-decoder.md", [];
    photographs: "docs/src/guides/photographs.md", [];
    calibrate: "docs/src/guides/calibrate.md", [];
    compare: "docs/src/guides/compare.md", [];
    gpu: "docs/src/guides/gpu.md", [];
    patients: "docs/src/guides/patients.md", [];
    time: "docs/src/concepts/time.md", ["evm/summary.json"];
    studies: "docs/src/studies/index.md", [];
}

#[test]
fn every_page_with_commands_is_listed() {
    for page in pages() {
        let commands = blocks(&page).iter().any(|block| block.info == ["sh"]);
        let page = page.to_str().unwrap();
        assert_eq!(commands, RUN.contains(&page), "{page}");
    }
}

/// Runs the commands that need Python packages; a lane of `.ci/run` provides them.
#[test]
#[ignore = "needs python3 with numpy and pyserial"]
fn foreign_clients_run() {
    let mut count = 0;
    for page in pages() {
        if blocks(&page)
            .iter()
            .any(|block| block.info == ["sh", "foreign"])
        {
            run(page.to_str().unwrap(), &["foreign"]);
            count += 1;
        }
    }
    assert!(count > 0);
}
