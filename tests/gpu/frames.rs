//! Several frames in progress on the GPU at the same time.

use crate::case::Case;
use phasmid::emulator::Shot;
use phasmid::emulator::render::Backend;
use phasmid::protocol::Frame;

/// Frames submitted together equal frames rendered one by one.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn frames_submitted_together_equal_single_ones() {
    let case = Case::new("frames", "plane");
    let shots: Vec<Shot> = (0..7)
        .map(|i| Shot {
            noise_id: i,
            ..case.shots[i as usize % 2].clone()
        })
        .collect();
    let frames = same_together(&case, &shots);
    assert!(frames[0].data != frames[2].data, "noise");
}

/// Frames submitted together equal frames rendered one by one for a moving scene too, in which edges
/// come into view from frame to frame.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn frames_of_moving_scene_submitted_together_equal_single_ones() {
    let ball = |i: i32| {
        let (x, y) = (
            f64::from(i % 5) * 60.0 - 120.0,
            f64::from(i / 5) * 50.0 - 50.0,
        );
        format!(
            "[[object]]\nshape = {{ kind = \"sphere\", radius_mm = 18.0 }}\nalbedo = 0.7\n\
             position_mm = [{x}, {y}, 4000]\nmotion = {{ keyframes = [ {{ time_s = 0.01 }}, \
             {{ time_s = 0.05, position_mm = [0, 0, -3000] }} ] }}\n"
        )
    };
    let balls: String = (0..5 * 3).map(ball).collect();
    let mut case = Case::new("balls", &balls);
    case.options.time_samples = 2;
    let shots: Vec<Shot> = (0..5)
        .map(|i| Shot {
            noise_id: i,
            start_ns: i * 12_000_000,
            ..case.shots[0].clone()
        })
        .collect();
    same_together(&case, &shots);
}

/// Renders shots, each of which is begun before the previous one is finished, and checks that the
/// frames equal frames rendered one by one.
fn same_together(case: &Case, shots: &[Shot]) -> Vec<Frame> {
    let mut alone = case.renderer(Backend::Gpu);
    let mut together = case.renderer(Backend::Gpu);
    assert!(together.depth() >= 2, "{}", together.depth());
    let mut under_way = std::collections::VecDeque::new();
    let mut frames = Vec::new();
    for shot in shots {
        under_way.push_back(together.submit(shot));
        if under_way.len() == together.depth() {
            frames.extend(under_way.pop_front().map(|p| together.finish(p)));
        }
    }
    frames.extend(under_way.into_iter().map(|p| together.finish(p)));
    for (shot, frame) in shots.iter().zip(&frames) {
        assert_eq!(alone.expose(shot), *frame);
    }
    assert!(together.adapter().is_some() && together.news().is_ok());
    frames
}
