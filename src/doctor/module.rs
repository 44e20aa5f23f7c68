//! The kernel module v4l2loopback: loaded, installed, or how to get it.

use super::{Check, Feature, Machine, Status};

/// Where a loaded module shows itself.
pub(super) const LOADED: &str = "sys/module/v4l2loopback";
/// Loads it anew, with the options that are installed.
pub(super) const RELOAD: &str = "sudo modprobe -r v4l2loopback; sudo modprobe v4l2loopback";
/// Readers that fall this many frames behind lose some; the module's most.
const BUFFERS: u32 = 32;

pub(super) fn check(machine: &Machine) -> Check {
    let check = |found: String| Check::ok("v4l2loopback", Feature::V4l2, found);
    if machine.has(LOADED) {
        return loaded(machine);
    }
    if machine.container() {
        return check("not loaded, and a container loads no modules".into()).but(
            Status::Missing,
            "on the host: sudo modprobe v4l2loopback; then give the container /dev/video10 (docker run --device)"
                .to_owned(),
        );
    }
    let modules = format!("lib/modules/{}/modules.dep", machine.release);
    let Some(modules) = machine.text(modules) else {
        return check(format!(
            "not loaded, and kernel {} has no list of modules here",
            machine.release
        ))
        .but(Status::Missing, install(machine));
    };
    let installed = modules
        .lines()
        .filter_map(|line| line.split(':').next()?.rsplit('/').next())
        .any(|file| file.starts_with("v4l2loopback.ko"));
    if installed {
        check("installed, not loaded".into())
            .but(Status::Missing, "sudo modprobe v4l2loopback".to_owned())
    } else {
        check(format!("not installed for kernel {}", machine.release))
            .but(Status::Missing, install(machine))
    }
}

/// How to get the module, by what the system installs packages with.
fn install(machine: &Machine) -> String {
    let commands = [
        (
            "usr/bin/apt-get",
            format!(
                "sudo apt-get install v4l2loopback-dkms linux-headers-{}",
                machine.release
            ),
        ),
        ("usr/bin/pacman", "sudo pacman -S v4l2loopback-dkms".into()),
        (
            "usr/bin/dnf",
            "sudo dnf install v4l2loopback (from RPM Fusion)".into(),
        ),
    ];
    commands
        .into_iter()
        .find(|(tool, _)| machine.has(tool))
        .map_or_else(
            || "git clone https://github.com/v4l2loopback/v4l2loopback && cd v4l2loopback && make && sudo make install && sudo depmod".into(),
            |(_, command)| command,
        )
}

fn loaded(machine: &Machine) -> Check {
    let version = version(machine).unwrap_or_else(|| "of unknown version".into());
    let mut found = format!("{version} is loaded");
    // From 0.14 on a format and a stream belong to one opener.
    let mut parts = version.split('.').map(|part| part.parse::<u32>().ok());
    if (parts.next().flatten(), parts.next().flatten()) >= (Some(0), Some(14)) {
        found += "; one reader at a time";
    }
    match buffers(machine) {
        Some(buffers) if buffers < BUFFERS => {
            found += &format!(
                "; max_buffers={buffers}: a reader that is {buffers} frames late loses some, {BUFFERS} is the most"
            );
            Check::ok("v4l2loopback", Feature::V4l2, found)
                .but(Status::Note, super::installed::install_options())
        }
        Some(buffers) => Check::ok(
            "v4l2loopback",
            Feature::V4l2,
            format!("{found}; max_buffers={buffers}"),
        ),
        None => Check::ok("v4l2loopback", Feature::V4l2, found),
    }
}

/// The version of the loaded module; 0.12 as released does not tell, but DKMS knows what it built.
fn version(machine: &Machine) -> Option<String> {
    machine.line(format!("{LOADED}/version")).or_else(|| {
        let built = machine.list("var/lib/dkms/v4l2loopback");
        // Beside versions stand links called after kernels.
        let mut versions = built
            .iter()
            .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
            .filter(|name| name.starts_with(|c: char| c.is_ascii_digit()));
        // Of several nobody knows which one is loaded.
        versions.next().filter(|_| versions.next().is_none())
    })
}

/// The module's `max_buffers`.
pub(super) fn buffers(machine: &Machine) -> Option<u32> {
    machine
        .line(format!("{LOADED}/parameters/max_buffers"))?
        .parse()
        .ok()
}

/// Whether the node of this number, the `index`-th by number, is a camera and nothing else.
/// `None` where the module does not tell.
pub(super) fn exclusive(machine: &Machine, number: u32, index: usize) -> Option<bool> {
    let list = |name: &str| {
        let line = machine.line(format!("{LOADED}/parameters/{name}"))?;
        Some(line.split(',').map(str::to_owned).collect::<Vec<_>>())
    };
    // Nodes whose number the module chose itself come in order.
    let numbers = list("video_nr").unwrap_or_default();
    let number = number.to_string();
    let at = numbers.iter().position(|n| *n == number).unwrap_or(index);
    list("exclusive_caps")?.get(at).map(|caps| caps == "Y")
}
