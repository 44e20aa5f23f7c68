//! Information for the report that is not part of the calibration.

/// Origin of a calibration.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct About {
    /// The command and its version: `phasmid calibrate 0.1.0`.
    pub made_by: String,
    /// Other entries of the report's head, as name and value: device, sequence, seed, distance to a
    /// known truth.
    pub remarks: Vec<(String, String)>,
    /// For each pose, including poses without a board: its name, and the image file in the report's
    /// folder that shows the detected board.
    pub images: Vec<(String, String)>,
}

impl About {
    /// Returns the image file of a pose.
    pub(super) fn image(&self, pose: &str) -> Option<&str> {
        let found = self.images.iter().find(|(name, _)| name == pose);
        found.map(|(_, file)| file.as_str())
    }
}

/// Maximum number of characters of a pose's name that are kept in its file name.
const KEPT: usize = 100;

/// Returns file names for the images of poses, one for each name in order: `found_NAME.png`. They
/// consist of characters that need no quoting and are unique even if case is ignored.
pub fn image_names<S: AsRef<str>>(poses: &[S]) -> Vec<String> {
    let plain: Vec<String> = poses.iter().map(|name| plain(name.as_ref())).collect();
    let mut taken = std::collections::BTreeSet::new();
    // A name that needs no change is kept even if another name is changed to the same text.
    let mut names: Vec<Option<String>> = poses
        .iter()
        .zip(&plain)
        .map(|(name, plain)| {
            let own = name.as_ref() == plain && taken.insert(plain.to_lowercase());
            own.then(|| plain.clone())
        })
        .collect();
    for (name, plain) in names.iter_mut().zip(&plain) {
        if name.is_none() {
            let free = std::iter::once(plain.clone())
                .chain((2..).map(|n| format!("{plain}-{n}")))
                .find(|candidate| taken.insert(candidate.to_lowercase()));
            *name = free;
        }
    }
    names
        .into_iter()
        .flatten()
        .map(|name| format!("found_{name}.png"))
        .collect()
}

fn plain(name: &str) -> String {
    name.chars()
        .take(KEPT)
        .map(|c| match c {
            'A'..='Z' | 'a'..='z' | '0'..='9' | '-' | '_' => c,
            _ => '_',
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_different_poses_have_different_plain_names() {
        let names = ["a b", "a_b", "A_B", "../x", "a?b", "", "ü", "pose_07"];
        assert_eq!(
            image_names(&names),
            [
                "found_a_b-2.png",
                "found_a_b.png",
                "found_A_B-3.png",
                "found____x.png",
                "found_a_b-4.png",
                "found_.png",
                "found__.png",
                "found_pose_07.png"
            ]
        );
        let long = ["x".repeat(4000), "x".repeat(4001)];
        assert!(image_names(&long).iter().all(|name| name.len() < 120));
        let same = vec!["same"; 300];
        let names = image_names(&same);
        let all: std::collections::BTreeSet<&String> = names.iter().collect();
        assert_eq!(all.len(), 300);
    }
}
