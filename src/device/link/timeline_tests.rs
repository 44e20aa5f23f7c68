//! Tests of seats that wait, and of steps that are requested, completed and cancelled.

use super::*;
use std::future::Future;

fn run<T>(future: impl Future<Output = T>) -> T {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_time()
        .build();
    runtime.unwrap().block_on(future)
}

fn timeline(pace: ClockPace) -> Timeline {
    Timeline::new(pace, || Duration::ZERO)
}

fn until(next_ns: u64) -> Wait {
    Wait {
        next_ns: Some(next_ns),
        limit_ns: None,
        settled: true,
    }
}

const NOTHING: Wait = Wait {
    next_ns: None,
    limit_ns: None,
    settled: true,
};

/// Logs the times at which a device with a periodic event handles the event.
async fn beat(mut seat: Seat, period_ns: u64, count: u64, log: Arc<Mutex<Vec<(u64, u64)>>>) {
    for beat in 1..=count {
        seat.wait(until(beat * period_ns)).await;
        log.lock().unwrap().push((seat.now_ns(), period_ns));
    }
}

#[test]
fn devices_on_threads_of_their_own_take_turns_by_device_time() {
    let timeline = timeline(ClockPace::Fast);
    let log = Arc::new(Mutex::new(Vec::new()));
    let seats = [(3, 200), (7, 100), (11, 50)].map(|beat| (beat, timeline.seat()));
    let devices = seats.map(|((period, count), seat)| {
        let log = log.clone();
        std::thread::spawn(move || run(beat(seat, period, count, log)))
    });
    for device in devices {
        device.join().unwrap();
    }
    let got = log.lock().unwrap().clone();
    assert_eq!(got.len(), 350);
    assert!(got.windows(2).all(|pair| pair[0].0 <= pair[1].0), "{got:?}");
    assert!(got.iter().all(|(now, period)| now % period == 0), "{got:?}");
    assert_eq!(timeline.now_ns(), 700);
}

#[test]
fn time_does_not_pass_the_limit_of_a_waiting_device() {
    let timeline = timeline(ClockPace::Fast);
    let (mut one, mut two) = (timeline.seat(), timeline.seat());
    run(async {
        let held = Wait {
            limit_ns: Some(50),
            ..NOTHING
        };
        let beyond = tokio::time::timeout(Duration::from_millis(5), async {
            tokio::join!(one.wait(held), two.wait(until(50)))
        });
        assert!(beyond.await.is_err());
        assert_eq!(timeline.now_ns(), 0);
        tokio::select! {
            () = one.wait(held) => panic!("this device has no event"),
            () = two.wait(until(49)) => {}
        }
        assert_eq!(timeline.now_ns(), 49);
        // The seat `one` counts as busy until it is dropped.
        let busy = tokio::time::timeout(Duration::from_millis(5), two.wait(until(60)));
        assert!(busy.await.is_err());
        drop(one);
        two.wait(until(60)).await;
        assert_eq!(timeline.now_ns(), 60);
    });
}

#[test]
fn stepped_time_stops_at_target_and_reports_completion() {
    let timeline = timeline(ClockPace::Stepped);
    let log = Arc::new(Mutex::new(Vec::new()));
    let mut seat = timeline.seat();
    run(async {
        let mut step = timeline.step(1000).unwrap();
        for due in [400, 1000] {
            seat.wait(until(due)).await;
            log.lock().unwrap().push(timeline.now_ns());
            assert!(
                step.ended.try_recv().is_err(),
                "the event at the end is not handled yet"
            );
        }
        // An operation is in progress, so the step does not end.
        let wait = seat.wait(Wait::default());
        assert!(
            tokio::time::timeout(Duration::from_millis(5), wait)
                .await
                .is_err()
        );
        assert!(step.ended.try_recv().is_err());
        tokio::select! {
            () = seat.wait(until(1001)) => panic!("time must not pass the end of the step"),
            now = &mut step.ended => assert_eq!(now, Ok(Stepped::Done(1000))),
        }
        let wait = tokio::time::timeout(Duration::from_millis(5), seat.wait(until(1001)));
        assert!(wait.await.is_err());
        assert_eq!(timeline.now_ns(), 1000);
        // Two concurrent steps both complete.
        let mut steps = [
            timeline.step(10).unwrap(),
            timeline.run_until(1500).unwrap(),
        ];
        seat.wait(until(1001)).await;
        assert_eq!(timeline.now_ns(), 1001);
        let wait = tokio::time::timeout(Duration::from_millis(5), seat.wait(NOTHING));
        assert!(wait.await.is_err());
        let done = Ok(Stepped::Done(1500));
        assert!(steps.iter_mut().all(|step| step.ended.try_recv() == done));
    });
    assert_eq!(*log.lock().unwrap(), [400, 1000]);
    let refused = timeline.run_until(1499).unwrap_err().to_string();
    assert!(refused.contains("1500 to 86400000001500"), "{refused}");
    assert!(timeline.step(MAX_STEP_NS + 1).is_err());
}

#[test]
fn steps_can_be_cancelled() {
    const DAY: u64 = MAX_STEP_NS;
    let timeline = timeline(ClockPace::Stepped);
    let mut seat = timeline.seat();
    run(async {
        let mut long = timeline.step(DAY).unwrap();
        seat.wait(until(700)).await;
        // A later step starts from the present time.
        timeline.stop().unwrap();
        assert_eq!(long.ended.try_recv(), Ok(Stepped::CalledOff(700)));
        let still = tokio::time::timeout(Duration::from_millis(5), seat.wait(until(701)));
        assert!(still.await.is_err());
        assert_eq!(timeline.now_ns(), 700);
        // If a client disconnects, only its own step is cancelled.
        let mut short = timeline.step(100).unwrap();
        let long = timeline.step(DAY).unwrap();
        timeline.give_up(long.number);
        timeline.give_up(long.number);
        seat.wait(until(800)).await;
        let still = tokio::time::timeout(Duration::from_millis(5), seat.wait(until(801)));
        assert!(still.await.is_err());
        assert_eq!(short.ended.try_recv(), Ok(Stepped::Done(800)));
        let long = timeline.step(DAY).unwrap();
        seat.wait(until(900)).await;
        timeline.give_up(long.number);
        let still = tokio::time::timeout(Duration::from_millis(5), seat.wait(until(901)));
        assert!(still.await.is_err());
        assert_eq!(timeline.now_ns(), 900);
    });
}

#[test]
fn only_stepped_time_is_stepped_and_only_real_time_is_late() {
    let fast = timeline(ClockPace::Fast);
    assert!(
        fast.step(1)
            .unwrap_err()
            .to_string()
            .contains("--clock stepped")
    );
    assert!(
        fast.stop()
            .unwrap_err()
            .to_string()
            .contains("--clock stepped")
    );
    let late = Duration::from_millis(7);
    let real = Timeline::new(ClockPace::Real, move || late);
    assert!(
        real.run_until(1)
            .unwrap_err()
            .to_string()
            .contains("the wall clock")
    );
    let seat = real.seat();
    seat.handled(2_000_000);
    seat.handled(4_000_000);
    let about = real.about();
    assert_eq!((about.pace, about.now_ns), (ClockPace::Real, 7_000_000));
    let late = about.late.unwrap();
    assert_eq!(
        (late.events, late.mean_ns, late.max_ns),
        (2, 4_000_000, 5_000_000)
    );
    assert_eq!(fast.about().late, None);
    assert_eq!(fast.about().rendering, None);
    let seats = [fast.seat(), fast.seat()];
    seats[0].rendered(Duration::from_millis(20), Duration::from_millis(30));
    seats[1].rendered(Duration::from_millis(10), Duration::from_millis(30));
    let rendering = fast.about().rendering.unwrap();
    assert_eq!((rendering.frames, rendering.real_time_factor), (2, 0.5));
}

#[test]
fn time_goes_on_when_its_pace_changes() {
    let wall = Arc::new(Mutex::new(Duration::from_millis(5)));
    let timeline = {
        let wall = wall.clone();
        Timeline::new(ClockPace::Real, move || *wall.lock().unwrap())
    };
    let pass = |ms| *wall.lock().unwrap() += Duration::from_millis(ms);
    assert_eq!(timeline.now_ns(), 5_000_000);
    timeline.set_pace(ClockPace::Stepped).unwrap();
    pass(100);
    assert_eq!(timeline.now_ns(), 5_000_000, "time stands still");
    assert_eq!(timeline.about().late, None);
    let mut seat = timeline.seat();
    run(async {
        let step = timeline.step(7_000_000).unwrap();
        let device = async {
            seat.wait(until(6_000_000)).await;
            assert_eq!(seat.now_ns(), 6_000_000);
            seat.wait(NOTHING).await;
        };
        let other = async {
            assert_eq!(step.ended.await.unwrap(), Stepped::Done(12_000_000));
            let _busy = timeline.seat();
            let next = timeline.step(1_000_000_000).unwrap();
            // A waiting device continues to wait at the new pace, and the step in progress is
            // cancelled.
            timeline.set_pace(ClockPace::Real).unwrap();
            assert_eq!(next.ended.await.unwrap(), Stepped::CalledOff(12_000_000));
        };
        tokio::join!(device, other);
    });
    pass(3);
    assert_eq!(timeline.now_ns(), 15_000_000);
    assert!(timeline.step(1).is_err());
    timeline.set_pace(ClockPace::Fast).unwrap();
    run(seat.wait(until(20_000_000)));
    assert_eq!(timeline.now_ns(), 20_000_000);
    timeline.keep_real();
    let refused = timeline.set_pace(ClockPace::Stepped).unwrap_err();
    let words = refused.to_string();
    assert!(
        words.starts_with("clock.pace: stepped; expected real"),
        "{words}"
    );
    timeline.set_pace(ClockPace::Real).unwrap();
}
