use glam::DVec2;
use phasma::emulator::render::{Renderer, reference::Reference};
use phasma::emulator::{Shot, Slide};
use phasma::pattern::{Axis, Pattern};
use phasma::profile::{Profile, Scene};
use std::sync::Arc;
fn main() {
    let profile = Profile::load("pmp-bench").unwrap();
    let scene = Scene::load("plane").unwrap();
    let slide = Arc::new(
        Slide::new(
            &Pattern::Gray {
                axis: Axis::X,
                cell_px: 8.0,
                bits: 8,
                bit: 0,
                inverted: false,
            },
            &profile.projector,
            &|_| unreachable!(),
        )
        .unwrap(),
    );
    let shot = Shot {
        id: 1,
        pattern_index: None,
        slide: Some(slide.clone()),
        light: 1.0,
        start_ns: 0,
        exposure_ns: 8_000_000,
        gain_db: 0.0,
    };
    let mut r = Renderer::new(&profile, &scene, 1, false).unwrap();
    let refr = Reference::new(&profile, &scene).unwrap();
    let fast = r.expected_dn(&shot);
    let t = r.truth(&[]);
    let mut v = vec![];
    for i in (0..t.flags.len()).step_by(97) {
        if t.flags[i] & 8 != 0 || t.flags[i] & 2 == 0 {
            continue;
        }
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let a = refr.signal_dn(px, &slide, 8e-3, 4181);
        v.push(((fast[i] as f64 - a).abs(), px, t.projector_x[i], fast[i], a));
    }
    v.sort_by(|a, b| b.0.total_cmp(&a.0));
    println!("{}", v.len());
    for e in v.iter().take(12) {
        println!("{e:?}");
    }
    println!("{:?}", v[v.len() / 2]);
}
