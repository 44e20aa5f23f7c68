//! Checks whether the kernel module v4l2loopback is loaded or at least installed; if not, says how
//! to get it.

use super::{Check, Feature, Machine, Status};

/// Folder that exists if the module is loaded.
pub(super) const LOADED: &str = "sys/module/v4l2loopback";
/// Recommended number of buffers, which is the module's maximum. The more buffers, the later a frame is
/// overwritten.
const BUFFERS: u32 = 32;

pub(super) fn check(machine: &Machine) -> Check {
    let check = |found: String| Check::ok("v4l2loopback", Feature::V4l2, found);
    if machine.has(LOADED) {
        return loaded(machine);
    }
    if machine.container() {
        return check(
            "not loaded, and a container loads no modules: load it on the host, then start the container with `--device /dev/video10`"
                .into(),
        )
        .but(Status::Missing, "sudo modprobe v4l2loopback".to_owned());
    }
    let modules = format!("lib/modules/{}/modules.dep", machine.release);
    let Some(modules) = machine.text(modules) else {
        return check(format!(
            "not loaded, and the list of modules of kernel {} is missing{}",
            machine.release,
            source(machine)
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
        check(format!(
            "not installed for kernel {}{}",
            machine.release,
            source(machine)
        ))
        .but(Status::Missing, install(machine))
    }
}

/// Returns a remark that names the repository with the package, if the package is not in the
/// distribution's own repositories.
fn source(machine: &Machine) -> &'static str {
    if package_tool(machine) == Some("usr/bin/dnf") {
        "; the package is in RPM Fusion"
    } else {
        ""
    }
}

/// Returns the system's package manager.
fn package_tool(machine: &Machine) -> Option<&'static str> {
    let tools = ["usr/bin/apt-get", "usr/bin/pacman", "usr/bin/dnf"];
    tools.into_iter().find(|tool| machine.has(tool))
}

/// Returns the command that installs the module with the system's package manager.
fn install(machine: &Machine) -> String {
    match package_tool(machine) {
        Some("usr/bin/apt-get") => format!(
            "sudo apt-get install v4l2loopback-dkms linux-headers-{}",
            machine.release
        ),
        Some("usr/bin/pacman") => "sudo pacman -S v4l2loopback-dkms".into(),
        Some(_) => "sudo dnf install v4l2loopback".into(),
        None => "git clone https://github.com/v4l2loopback/v4l2loopback && cd v4l2loopback && make && sudo make install && sudo depmod".into(),
    }
}

fn loaded(machine: &Machine) -> Check {
    let version = version(machine).unwrap_or_else(|| "of unknown version".into());
    let mut found = format!("{version} is loaded");
    // Since release 0.14, format and stream belong to one open file handle, so only one reader can
    // stream at a time.
    let mut parts = version.split('.').map(|part| part.parse::<u32>().ok());
    if (parts.next().flatten(), parts.next().flatten()) >= (Some(0), Some(14)) {
        found += "; one reader at a time";
    }
    match buffers(machine) {
        Some(buffers) if buffers < BUFFERS => {
            found += &format!(
                "; max_buffers={buffers}: a frame that is being read is overwritten {buffers} frames later; the maximum is {BUFFERS}"
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

/// Returns the version of the loaded module. Release 0.12 does not report its version, but DKMS
/// knows which version it has built.
fn version(machine: &Machine) -> Option<String> {
    machine.line(format!("{LOADED}/version")).or_else(|| {
        let built = machine.list("var/lib/dkms/v4l2loopback");
        // Skip the symbolic links in this folder, which are named after kernels.
        let mut versions = built
            .iter()
            .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
            .filter(|name| name.starts_with(|c: char| c.is_ascii_digit()));
        // If DKMS has built several versions, the loaded version is unknown.
        versions.next().filter(|_| versions.next().is_none())
    })
}

/// Returns the module's parameter `max_buffers`.
pub(super) fn buffers(machine: &Machine) -> Option<u32> {
    machine
        .line(format!("{LOADED}/parameters/max_buffers"))?
        .parse()
        .ok()
}

/// Returns whether a node shows only its capture side while it has a producer (`exclusive_caps`).
/// `number` is the node's number, `index` its index in order of number. `None` if the module does not
/// report this.
pub(super) fn exclusive(machine: &Machine, number: u32, index: usize) -> Option<bool> {
    let list = |name: &str| {
        let line = machine.line(format!("{LOADED}/parameters/{name}"))?;
        Some(line.split(',').map(str::to_owned).collect::<Vec<_>>())
    };
    // If the module chose the numbers of its nodes, the nodes are in the order of their index.
    let numbers = list("video_nr").unwrap_or_default();
    let number = number.to_string();
    let at = numbers.iter().position(|n| *n == number).unwrap_or(index);
    list("exclusive_caps")?.get(at).map(|caps| caps == "Y")
}
