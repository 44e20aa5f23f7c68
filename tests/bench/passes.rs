//! Rates of the passes, each beside a memory copy of the same bytes in the same run.

use phasma::emulator::render::Renderer;
use phasma::emulator::{Shot, Slide};
use phasma::profile::{Profile, Scene};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

fn main() {
    let profile = Profile::load("pmp-bench").expect("built in");
    for name in ["trapezoid", "torso"] {
        let scene = Scene::load(name).expect("built in");
        let mut renderer = Renderer::new(&profile, &scene, 1, true).expect("built in");
        let slides: Vec<_> = profile.sequence[0]
            .frame
            .iter()
            .map(|f| {
                let none = |_: &std::path::Path| unreachable!("no images");
                Arc::new(Slide::new(&f.pattern, &profile.projector, &none).expect("has a formula"))
            })
            .collect();
        renderer.expect_slides(slides.iter().map(AsRef::as_ref));
        let geometry = best(7, || {
            renderer.invalidate();
            renderer.prepare();
        });
        let mut id = 0;
        let frame = best(10, || {
            for (i, slide) in slides.iter().enumerate() {
                id += 1;
                black_box(renderer.expose(&shot(id, i as u32, slide.clone())));
            }
        }) / slides.len() as f64;
        println!(
            "{name}: {} triangles, geometry {:.1} ms, frame {:.2} ms",
            renderer.triangle_count(),
            geometry * 1e3,
            frame * 1e3
        );
        if std::env::var_os("DUMP").is_some() {
            for (i, slide) in slides.iter().enumerate() {
                let f = renderer.expose(&shot(i as u64, i as u32, slide.clone()));
                image::GrayImage::from_raw(f.width, f.height, f.data)
                    .unwrap()
                    .save(format!("/tmp/{name}_{i:02}.png"))
                    .unwrap();
            }
        }
    }
}

fn shot(id: u64, index: u32, slide: Arc<Slide>) -> Shot {
    Shot {
        id,
        pattern_index: Some(index),
        slide: Some(slide),
        light: 1.0,
        start_ns: 0,
        exposure_ns: 8_000_000,
        gain_db: 0.0,
    }
}

fn best(times: usize, mut run: impl FnMut()) -> f64 {
    run();
    (0..times)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}
