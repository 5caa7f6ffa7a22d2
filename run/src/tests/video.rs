//! Which pictures of a camera are late.

use std::time::{Duration, Instant};

use meissner_io::Image;
use proptest::prelude::*;

use crate::run::video::{MAX_WAITING, VideoPicture, Waiting};

const PERIOD: Duration = Duration::from_millis(40);

fn picture(number: u64, arrived: Instant) -> VideoPicture {
    VideoPicture { image: Image { width: 1, height: 1, data: vec![0; 3] }, number, arrived }
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// The numbers of the pictures that are taken at these times, and how many are late.
fn taken(arrivals: &[u64], times: &[u64]) -> (Vec<Option<u64>>, u64) {
    let start = Instant::now();
    let mut waiting = Waiting::default();
    let mut left = arrivals.iter().zip(0..).peekable();
    let taken = times.iter().map(|&time| {
        while let Some((&arrived, number)) = left.next_if(|&(&arrived, _)| arrived <= time) {
            waiting.offer(picture(number, start + ms(arrived)));
        }
        waiting.take(start + ms(time), PERIOD).map(|picture| picture.number)
    });
    (taken.collect(), waiting.late)
}

#[test]
fn a_network_in_time_takes_every_picture() {
    assert_eq!(taken(&[0, 40, 80], &[0, 40, 80, 81]), (vec![Some(0), Some(1), Some(2), None], 0));
    // The camera has its own clock, and pictures come in bursts.
    assert_eq!(taken(&[0, 79, 80, 80], &[0, 80, 90, 120]), (vec![Some(0), Some(1), Some(2), Some(3)], 0));
}

#[test]
fn a_picture_is_late_that_waited_longer_than_a_period_while_a_newer_one_is_there() {
    assert_eq!(taken(&[0, 40, 80, 120], &[0, 140]), (vec![Some(0), Some(3)], 2));
    assert_eq!(taken(&[0, 40], &[80, 81]), (vec![Some(1), None], 1));
    // After exactly one period a picture is not late.
    assert_eq!(taken(&[40, 41], &[80]), (vec![Some(0)], 0));
}

#[test]
fn the_newest_picture_is_never_late() {
    assert_eq!(taken(&[0], &[3_600_000]), (vec![Some(0)], 0));
}

#[test]
fn more_pictures_than_may_wait_are_late_however_fast_they_come() {
    let first = 10 - MAX_WAITING as u64;
    assert_eq!(taken(&[5; 10], &[5]), (vec![Some(first)], first));
}

proptest! {
    #[test]
    fn pictures_are_taken_in_order_late_or_waiting_and_wait_no_longer_than_a_period_or_are_the_newest(
        steps in prop::collection::vec((0..100_u64, any::<bool>()), 1..100),
    ) {
        let (start, mut now, mut waiting) = (Instant::now(), 0, Waiting::default());
        let (mut offered, mut taken, mut newest) = (0, 0, None);
        for (step, arrives) in steps {
            now += step;
            let at = start + ms(now);
            if arrives {
                waiting.offer(picture(offered, at));
                offered += 1;
            } else if let Some(picture) = waiting.take(at, PERIOD) {
                taken += 1;
                prop_assert!(Some(picture.number) > newest);
                prop_assert!(at - picture.arrived <= PERIOD || picture.number + 1 == offered);
                newest = Some(picture.number);
            }
            let left = offered - taken - waiting.late;
            prop_assert!(left <= MAX_WAITING as u64, "{left} wait");
        }
    }
}
