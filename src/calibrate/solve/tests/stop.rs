//! A request to stop ends every stage of the solver.

use super::super::bundle::Bundle;
use super::super::coefficients::free;
use super::super::model::State;
use super::super::{Choice, Unsolved, solve_with_stop, start};
use super::scene::Scene;
use phasmid_core::Stop;
use phasmid_core::error::Error;

const NONE: [[bool; 5]; 2] = [[false; 5]; 2];

fn scene() -> Scene {
    Scene::bench(8, 3)
}

/// A bundle whose stop has been requested, and the initial state that it would have found without
/// the request.
fn asked(choice: &Choice) -> (Bundle, State) {
    let scene = scene();
    let mut bundle = Bundle::new(&scene.board, &scene.sightings(Some(1)));
    let maps = start::maps(&mut bundle, choice.robust).unwrap();
    let state = start::state(&bundle, &maps, scene.sizes(), &NONE, choice).unwrap();
    bundle.stop.ask();
    (bundle, state)
}

fn interrupted<T>(result: Result<T, Unsolved>) -> bool {
    matches!(result, Err(Unsolved::Interrupted))
}

#[test]
fn every_stage_ends_when_asked() {
    let choice = Choice::default();
    let (mut bundle, mut state) = asked(&choice);
    let maps = start::maps(&mut bundle, true).unwrap();
    let sizes = scene().sizes();
    let started = start::state(&bundle, &maps, sizes, &NONE, &choice);
    assert!(interrupted(started));
    let approached = bundle.approach(&mut state, &free(&NONE), &choice, true);
    assert!(interrupted(approached));
    let settled = bundle.settle(state.clone(), &free(&NONE), &choice);
    assert!(interrupted(settled));
    assert!(interrupted(bundle.largest(&state, &[NONE], &choice)));
    assert!(interrupted(bundle.solve(sizes, &choice)));
}

#[test]
fn solves_only_until_another_thread_asks() {
    let (scene, stop, choice) = (scene(), Stop::default(), Choice::default());
    let [camera, projector] = scene.sizes();
    let sightings = scene.sightings(Some(1));
    std::thread::scope(|threads| {
        threads.spawn(|| stop.ask());
        let why = loop {
            let solved =
                solve_with_stop(&scene.board, &sightings, camera, projector, &choice, &stop);
            if let Err(why) = solved {
                break why;
            }
        };
        assert_eq!(why, Unsolved::Interrupted);
        assert!(matches!(Error::from(why), Error::Interrupted));
    });
    stop.reset();
    let solved = solve_with_stop(&scene.board, &sightings, camera, projector, &choice, &stop);
    assert!(solved.is_ok());
}
