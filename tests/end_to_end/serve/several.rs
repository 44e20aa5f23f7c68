//! Several devices served by one `phasmid serve`.

use crate::served::{LONG, phasmid, text};
use phasmid::host::usb::Client;
use phasmid::profile::faults::{Fault, What};
use phasmid::protocol::Endpoints;
use phasmid::protocol::service::{Item, Request, call};
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Writes a profile like webcam-grey with another serial number, and returns its path.
fn profile(folder: &Path, name: &str, serial: &str) -> String {
    let text = include_str!("../../../device-profiles/webcam-grey.toml")
        .replace("name = \"webcam-grey\"", &format!("name = \"{name}\""))
        .replace("serial = \"0001\"", &format!("serial = \"{serial}\""));
    assert!(text.contains(serial) && text.contains(name));
    let path = folder.join(format!("{serial}.toml"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn serve(options: &[&str]) -> Command {
    let mut command = phasmid();
    command.args(["serve", "--clock", "fast"]).args(options);
    command
}

/// Starts the command and returns its output until all devices are ready.
fn start(command: &mut Command) -> (Child, String) {
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        let line = line.unwrap();
        said += &line;
        said.push('\n');
        if line.starts_with("Ctrl-C") {
            break;
        }
    }
    (child, said)
}

fn end(mut child: Child) {
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn each_device_has_its_own_endpoints_scene_and_noise() {
    let base = tempfile::tempdir().unwrap();
    let run = base.path().join("run");
    let options = [
        ["--profile", "webcam-grey"],
        ["--profile", "webcam-grey"],
        ["--profile", "pmp-bench"],
        ["--scene", "plane"],
        ["--scene", "plane"],
        ["--scene", "sphere"],
    ];
    let (child, said) = start(
        serve(&options.concat())
            .args(["--seed", "7", "--run-dir"])
            .arg(&run),
    );
    let names = ["webcam-grey", "webcam-grey-2", "pmp-bench"];
    let at = names.map(|name| Endpoints::read(&run.join(name)).unwrap());
    assert_eq!(at.each_ref().map(|at| at.seed), [7, 8, 9].map(Some));
    assert_eq!(
        at.each_ref().map(|at| at.scene.as_deref().unwrap()),
        ["plane", "plane", "sphere"]
    );
    for at in &at {
        assert!(said.contains(&at.camera), "{said}");
    }
    let scans = [0, 1].map(|number| {
        let out = base.path().join(format!("scan-{number}"));
        let at = &at[number];
        let mut scan = phasmid();
        scan.args(["scan", "--camera", &at.camera, "--control"]);
        scan.arg(&at.control).arg("--out").arg(&out);
        (scan.stdout(Stdio::null()).spawn().unwrap(), out)
    });
    let clouds = scans.map(|(mut scan, out)| {
        assert_eq!(scan.wait().unwrap().code(), Some(0));
        std::fs::read(out.join("cloud.ply")).unwrap()
    });
    assert!(clouds[0] != clouds[1], "the devices have different noise");
    end(child);
    assert!(!run.exists(), "nothing is left behind");
}

#[test]
fn one_usb_server_exports_all_devices() {
    let base = tempfile::tempdir().unwrap();
    let profiles = ["A1", "B2"].map(|serial| profile(base.path(), "bench", serial));
    let options = [
        "--profile",
        &profiles[0],
        "--profile",
        &profiles[1],
        "--scene",
        "plane",
    ];
    let usb = ["--usb", "--usb-listen", "127.0.0.1:0", "--run-dir"];
    let run = base.path().join("run");
    let (child, said) = start(serve(&options).args(usb).arg(&run));
    let at = ["bench", "bench-2"].map(|name| Endpoints::read(&run.join(name)).unwrap());
    let addresses = at.each_ref().map(|at| at.usb.clone().unwrap());
    assert_eq!(at.each_ref().map(|at| &at.camera), addresses.each_ref());
    let host = addresses[0].strip_prefix("usb:").unwrap();
    let host = host.strip_suffix("/1-1").expect("the first on the bus");
    assert_eq!(addresses[1], format!("usb:{host}/1-2"), "{said}");
    let listed = Client::list(host, LONG).unwrap();
    let bus_ids: Vec<&str> = listed.iter().map(|device| device.bus_id.as_str()).collect();
    assert_eq!(bus_ids, ["1-1", "1-2"]);
    // Two separate hosts scan the two devices at the same time.
    let scans = addresses.each_ref().map(|address| {
        let out = base.path().join(&address[address.len() - 1..]);
        let mut scan = phasmid();
        scan.args(["scan", "--json", "--device", address, "--out"])
            .arg(out);
        scan.stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    });
    for (scan, serial) in scans.into_iter().zip(["A1", "B2"]) {
        let output = scan.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
        assert!(text(&output).contains(serial), "{}", text(&output));
    }
    // With several devices, a name is required.
    let output = phasmid()
        .args(["scan", "--device", &format!("usb:{host}"), "--out"])
        .arg(base.path().join("neither"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).contains("1-2"), "{}", text(&output));
    end(child);
}

#[test]
fn conflicting_options_are_refused_before_anything_is_made() {
    let base = tempfile::tempdir().unwrap();
    let other = profile(base.path(), "other", "0001");
    let run = base.path().join("run");
    let two = ["--profile", "webcam-grey", "--profile", "webcam-grey"];
    let cases: [(&[&str], &[&str]); 6] = [
        (&["--usb"], &["identity", "the same profile twice"]),
        (&["--usb", "--profile", &other], &["identity", "twice"]),
        (&["--tcp", "4000"], &["--tcp 4000", "--tcp 0"]),
        (
            &["--clock", "real", "--camera", "/dev/video9"],
            &["one node for 2 devices"],
        ),
        (
            &["--scene", "plane", "--scene", "plane", "--scene", "plane"],
            &["3 scenes for 2"],
        ),
        (&["--scene", "plane", "--scene", "no-such"], &["no-such"]),
    ];
    for (options, words) in cases {
        let mut command = phasmid();
        command
            .arg("serve")
            .args(two)
            .args(options)
            .arg("--run-dir")
            .arg(&run);
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        for word in words {
            assert!(text(&output).contains(word), "{word}: {}", text(&output));
        }
        assert!(!run.exists());
    }
}

#[test]
fn remains_of_killed_devices_are_removed_by_the_next_run() {
    let base = tempfile::tempdir().unwrap();
    let run = base.path().join("run");
    let two = ["--profile", "webcam-grey", "--profile", "webcam-grey"];
    let mut command = serve(&two);
    command.args(["--scene", "plane", "--run-dir"]).arg(&run);
    let (mut killed, _) = start(&mut command);
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(run.join("webcam-grey").exists());
    let (child, _) = start(&mut command);
    end(child);
    assert!(!run.exists());
}

#[test]
fn faults_for_a_device_that_is_not_served_are_refused() {
    let base = tempfile::tempdir().unwrap();
    let run = base.path().join("run");
    let bad = base.path().join("bad.toml");
    std::fs::write(&bad, "[[fault]]\nwhat = \"dark\"\ndevice = \"right\"\n").unwrap();
    let one = ["--profile", "webcam-grey", "--scene", "plane", "--faults"];
    let with_faults = |profiles: &[&str]| {
        let mut command = serve(&one[..2]);
        command.args(profiles).args(&one[2..]).arg(&bad);
        command.arg("--run-dir").arg(&run);
        command
    };
    for (profiles, allowed) in [
        (&[][..], "webcam-grey"),
        (&one[..2], "webcam-grey, webcam-grey-2"),
    ] {
        let output = with_faults(profiles).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        let words = format!("bad.toml:3: fault[0].device: \"right\"; expected {allowed}\n");
        assert!(text(&output).ends_with(&words), "{}", text(&output));
        assert!(!run.exists());
    }
    // A channel can belong to one device only.
    std::fs::write(
        &bad,
        "[[fault]]\nwhat = \"dark\"\ndevice = \"webcam-grey-2\"\n",
    )
    .unwrap();
    let (child, _) = start(&mut with_faults(&one[..2]));
    for (name, other) in [
        ("webcam-grey", "webcam-grey-2"),
        ("webcam-grey-2", "webcam-grey"),
    ] {
        let at = Endpoints::read(&run.join(name)).unwrap();
        let mut stream = UnixStream::connect(&at.service).unwrap();
        let fault = |device: &str| {
            let device = Some(device.to_owned());
            Request::Fault(Box::new(Fault {
                device,
                ..Fault::new(What::Nak)
            }))
        };
        let refused = call(&mut stream, &fault(other)).unwrap_err().to_string();
        let words = format!("fault.device: \"{other}\"; expected {name}");
        assert!(refused.ends_with(&words), "{refused}");
        let (reply, _) = call(&mut stream, &fault(name)).unwrap();
        assert_eq!(reply.fault, Some(2));
        let (reply, _) = call(&mut stream, &Request::Get(Item::Faults)).unwrap();
        let standing = reply.faults.unwrap().standing;
        let of_schedule = usize::from(name == "webcam-grey-2");
        assert_eq!(standing.len(), 1 + of_schedule);
    }
    end(child);
}

#[test]
fn device_that_cannot_be_served_ends_the_others() {
    let base = tempfile::tempdir().unwrap();
    let run = base.path().join("run");
    let taken = run.join("pmp-bench");
    std::fs::create_dir_all(&taken).unwrap();
    std::fs::write(taken.join("thesis.tex"), "years of work").unwrap();
    let two = [
        "--profile",
        "webcam-grey",
        "--profile",
        "pmp-bench",
        "--scene",
        "plane",
    ];
    let output = serve(&two).arg("--run-dir").arg(&run).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).contains("thesis") || text(&output).contains("not a device's"));
    assert!(!run.join("webcam-grey").exists(), "nothing is left behind");
    assert!(taken.join("thesis.tex").exists());
}
