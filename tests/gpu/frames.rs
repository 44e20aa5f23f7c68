//! Frames that a GPU works at together, and what becomes of them.

use crate::case::Case;
use phasma::emulator::Shot;
use phasma::emulator::render::Backend;

/// Frames begun one after the other are those that are made one by one.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn frames_under_way_together_are_the_same() {
    let case = Case::new("frames", "plane");
    let shots: Vec<Shot> = (0..7)
        .map(|i| Shot {
            noise_id: i,
            ..case.shots[i as usize % 2].clone()
        })
        .collect();
    let mut alone = case.renderer(Backend::Gpu);
    let mut together = case.renderer(Backend::Gpu);
    assert!(together.depth() >= 2, "{}", together.depth());
    let mut under_way = std::collections::VecDeque::new();
    let mut frames = Vec::new();
    for shot in &shots {
        under_way.push_back(together.submit(shot));
        if under_way.len() == together.depth() {
            frames.extend(under_way.pop_front().map(|p| together.finish(p)));
        }
    }
    frames.extend(under_way.into_iter().map(|p| together.finish(p)));
    for (shot, frame) in shots.iter().zip(&frames) {
        assert_eq!(alone.expose(shot), *frame);
    }
    assert!(frames[0].data != frames[2].data, "noise");
}
