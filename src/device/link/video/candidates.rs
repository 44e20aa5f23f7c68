//! Selects the V4L2 node to which the camera's frames are written.

use phasmid_core::error::Result;
use phasmid_protocol::printable;
use phasmid_v4l2::{FORGOTTEN, Node, RELOAD, node_paths};
use std::path::{Path, PathBuf};

/// Prefix, compared without case, of the labels of nodes that are meant for this program.
const LABEL: &str = "phasmid";

/// Returns the machine's nodes with their labels, ordered by number. Where possible a label is read
/// without opening the node, because opening a webcam may switch it on.
pub(super) fn nodes(dev: &Path, class: &Path) -> Vec<(PathBuf, String)> {
    let label = |path: &PathBuf| {
        let name = class.join(path.file_name()?).join("name");
        match std::fs::read_to_string(name) {
            Ok(name) => Some(name.trim_end().to_owned()),
            Err(_) => Node::open(path).ok().map(|(_, node)| node.card),
        }
    };
    let paths = node_paths(dev).into_iter();
    paths
        .filter_map(|path| label(&path).map(|label| (path, label)))
        .collect()
}

/// Opens the first node whose label shows that it is meant for this program and that can be opened.
/// Also returns why earlier nodes were skipped, joined with "; ", or an empty string.
///
/// # Errors
/// Returns an error if there is no such node, phrased to follow "the frame socket, because".
pub(super) fn first_free<T>(
    nodes: Vec<(PathBuf, String)>,
    mut open: impl FnMut(&Path) -> Result<T>,
) -> Result<(T, String), String> {
    let mut reasons = Vec::new();
    for (path, label) in nodes {
        if !label.to_lowercase().starts_with(LABEL) {
            continue;
        }
        match open(&path) {
            Ok(opened) => return Ok((opened, reasons.join("; "))),
            Err(reason) => reasons.push(reason.to_string()),
        }
    }
    if reasons.is_empty() {
        Err("no v4l2loopback node labelled Phasmid".to_owned())
    } else {
        Err(reasons.join("; "))
    }
}

/// Reason why frames cannot be written to a node.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Unfit {
    /// The node is not a loopback node: a mistake of the user who named it.
    Kind(String),
    /// The node is a loopback node to which frames cannot be written at present.
    State(String),
}

/// Checks the properties that a node reports; returns the reason if the node is unsuitable.
pub(super) fn unfit(node: &Node) -> Option<Unfit> {
    if !node.is_loopback() {
        return Some(Unfit::Kind(format!(
            "{:?} of driver {}, not a loopback",
            node.card,
            printable(&node.driver)
        )));
    }
    if node.is_forgotten() {
        return Some(Unfit::State(format!(
            "{FORGOTTEN}; reload the module: `{RELOAD}`"
        )));
    }
    if !node.outputs {
        return Some(Unfit::State(format!(
            "another program streams into it (`fuser -v {}` names it)",
            node.path.display()
        )));
    }
    if !node.streams {
        return Some(Unfit::State("it does not support streaming".to_owned()));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_core::error::Error;
    use phasmid_v4l2::LOOPBACK_DRIVER;

    fn node(driver: &str, outputs: bool, captures: bool) -> Node {
        Node {
            path: "/dev/video10".into(),
            driver: driver.into(),
            card: "Phasmid 1".into(),
            bus: "platform:v4l2loopback-000".into(),
            version: (6, 1, 0),
            captures,
            outputs,
            streams: true,
        }
    }

    #[test]
    fn only_a_loopback_node_without_a_producer_is_accepted() {
        assert_eq!(unfit(&node(LOOPBACK_DRIVER, true, true)), None);
        assert_eq!(unfit(&node(LOOPBACK_DRIVER, true, false)), None);
        assert!(matches!(
            unfit(&node(LOOPBACK_DRIVER, false, false)),
            Some(Unfit::State(why)) if why.contains("modprobe -r")
        ));
        assert!(matches!(
            unfit(&node(LOOPBACK_DRIVER, false, true)),
            Some(Unfit::State(why)) if why.contains("another program")
        ));
        for outputs in [true, false] {
            assert!(matches!(
                unfit(&node("uvcvideo", outputs, true)),
                Some(Unfit::Kind(what)) if what.contains("uvcvideo")
            ));
        }
    }

    #[test]
    fn the_first_free_node_labelled_for_us_is_taken() {
        let machine = || {
            ["Webcam", "PHASMID left", "Phasmid right", "phasmid third"]
                .iter()
                .zip(0..)
                .map(|(label, n)| (format!("/dev/video{n}").into(), (*label).to_owned()))
                .collect::<Vec<(PathBuf, String)>>()
        };
        let mut tried = Vec::new();
        let taken = first_free(machine(), |path| {
            tried.push(path.to_owned());
            match path.ends_with("video1") {
                true => Err(Error::device(format!("{}: taken", path.display()))),
                false => Ok(path.to_owned()),
            }
        });
        let passed_over = "/dev/video1: taken".to_owned();
        assert_eq!(taken, Ok(("/dev/video2".into(), passed_over)));
        let at_once = first_free(machine(), |path| Ok(path.to_owned()));
        assert_eq!(at_once, Ok(("/dev/video1".into(), String::new())));
        assert_eq!(tried, [Path::new("/dev/video1"), Path::new("/dev/video2")]);
        let refuse = |path: &Path| Err::<(), _>(Error::device(format!("{}: no", path.display())));
        assert_eq!(
            first_free(machine(), refuse),
            Err("/dev/video1: no; /dev/video2: no; /dev/video3: no".into())
        );
        let none = first_free(machine()[..1].to_vec(), refuse);
        assert!(none.unwrap_err().contains("labelled Phasmid"));
    }

    #[test]
    fn labels_come_from_the_system_s_list_in_the_order_of_numbers() {
        let root = tempfile::tempdir().unwrap();
        let (dev, class) = (root.path().join("dev"), root.path().join("class"));
        std::fs::create_dir(&dev).unwrap();
        for (name, label) in [("video10", "Phasmid b\n"), ("video2", "Phasmid a\n")] {
            std::fs::write(dev.join(name), "").unwrap();
            std::fs::create_dir_all(class.join(name)).unwrap();
            std::fs::write(class.join(name).join("name"), label).unwrap();
        }
        // A file that is neither listed nor a device is skipped.
        std::fs::write(dev.join("video5"), "").unwrap();
        assert_eq!(
            nodes(&dev, &class),
            [
                (dev.join("video2"), "Phasmid a".to_owned()),
                (dev.join("video10"), "Phasmid b".to_owned())
            ]
        );
    }
}
