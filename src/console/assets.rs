//! The files of the page, embedded in the program.

/// A file of the page.
pub(crate) struct Asset {
    /// Path in the address, after the `/`.
    pub(crate) name: &'static str,
    /// MIME type.
    pub(crate) kind: &'static str,
    /// Content.
    pub(crate) bytes: &'static [u8],
}

macro_rules! assets {
    ($($name:literal: $kind:literal),* $(,)?) => {
        &[$(Asset {
            name: $name,
            kind: $kind,
            bytes: include_bytes!(concat!("assets/", $name)),
        }),*]
    };
}

/// All files; the first one is the page itself.
pub(crate) const ASSETS: &[Asset] = assets! {
    "index.html": "text/html; charset=utf-8",
    "style.css": "text/css; charset=utf-8",
    "icon.svg": "image/svg+xml",
    "main.js": "text/javascript; charset=utf-8",
    "connection.js": "text/javascript; charset=utf-8",
    "picture.js": "text/javascript; charset=utf-8",
    "colours.js": "text/javascript; charset=utf-8",
    "result.js": "text/javascript; charset=utf-8",
    "chart.js": "text/javascript; charset=utf-8",
    "save.js": "text/javascript; charset=utf-8",
    "requests.js": "text/javascript; charset=utf-8",
    "panels.js": "text/javascript; charset=utf-8",
    "playback.js": "text/javascript; charset=utf-8",
    "calibration.js": "text/javascript; charset=utf-8",
    "marks.js": "text/javascript; charset=utf-8",
    "rows.js": "text/javascript; charset=utf-8",
    "view3d.js": "text/javascript; charset=utf-8",
    "room.js": "text/javascript; charset=utf-8",
    "room_scene.js": "text/javascript; charset=utf-8",
    "settings.js": "text/javascript; charset=utf-8",
    "terminal.js": "text/javascript; charset=utf-8",
    "traffic.js": "text/javascript; charset=utf-8",
    "world.js": "text/javascript; charset=utf-8",
    "scene.js": "text/javascript; charset=utf-8",
    "terms.js": "text/javascript; charset=utf-8",
    "cloud.js": "text/javascript; charset=utf-8",
    "three/three.module.min.js": "text/javascript; charset=utf-8",
    "three/three.core.min.js": "text/javascript; charset=utf-8",
    "three/OrbitControls.js": "text/javascript; charset=utf-8",
    "three/TransformControls.js": "text/javascript; charset=utf-8",
    "three/LICENSE": "text/plain; charset=utf-8",
    "histogram.js": "text/javascript; charset=utf-8",
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_weighs_little_and_names_only_its_own_files() {
        let weight: usize = ASSETS.iter().map(|asset| asset.bytes.len()).sum();
        assert!(weight < 3 << 20, "{weight} bytes");
        // Skip files from other projects, whose comments mention addresses. Browser tests check that the
        // page fetches nothing else.
        let own = { ASSETS.iter() }.filter(|asset| !asset.name.starts_with("three/"));
        for asset in own {
            let text = String::from_utf8_lossy(asset.bytes);
            // The SVG namespace is not fetched.
            let text = text.replace("http://www.w3.org/2000/svg", "");
            assert!(
                !text.contains("http://") && !text.contains("https://"),
                "{}",
                asset.name
            );
        }
    }
}
