//! Packets without a transport: gaps and their reasons, streams, saved states, and predictions bit
//! for bit.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use meissner_engine::{Event, Sensor};
use meissner_io::ReadOptions;
use meissner_packets::{
    AnyNetwork, Coverage, FeedOptions, Gap, LiveOptions, LiveSensor, Lost, Numbers, PacketError, Reason,
    Replay, SensorEngine, feed,
};
use meissner_run::RunError;
use meissner_run::source::Source;

/// Events of a packet.
const LEN: usize = 100;
/// The stream.
const STREAM: i64 = 7;
/// Enough for a test on a busy machine.
const DEADLINE: Duration = Duration::from_mins(2);

/// A small network, made once.
fn network() -> AnyNetwork {
    static NETWORK: OnceLock<AnyNetwork> = OnceLock::new();
    NETWORK.get_or_init(|| AnyNetwork::named("tactigraph-past", None).unwrap()).clone()
}

/// A small network over frames of events.
fn frame_network() -> AnyNetwork {
    AnyNetwork::named("force-lstm", None).unwrap()
}

/// The sensor and the first events of the embedded recording.
fn recording(events: usize) -> (Sensor, Vec<Event>) {
    let source = Source::open(None, &ReadOptions::default(), false, true).unwrap();
    let sensor = source.sensor(None).unwrap();
    (sensor, source.take(events).map(Result::unwrap).collect())
}

mod coverage {
    use super::{Coverage, Gap, Lost, Numbers, Reason};

    fn gap(from: u64, until: u64, packets: u64, reason: Reason) -> Gap {
        Gap { from, until, packets, reason }
    }

    fn is_balanced(coverage: &Coverage) -> bool {
        coverage.next == coverage.accepted + coverage.lost_events()
    }

    #[test]
    fn reasons_count_where_their_order_says_and_are_written_by_their_name() {
        for (place, reason) in Reason::ALL.into_iter().enumerate() {
            assert_eq!(reason as usize, place);
            assert_eq!(serde_json::to_value(reason).unwrap(), reason.name());
        }
    }

    #[test]
    fn events_in_order_are_taken_and_a_gap_is_lost_on_the_link() {
        let mut coverage = Coverage::default();
        let placed = coverage.place(0, Some(0), 10).unwrap();
        assert_eq!((placed.gap, placed.skip), (None, 0));
        coverage.take(10);
        let placed = coverage.place(3, Some(25), 5).unwrap();
        assert_eq!((placed.gap, placed.skip), (Some(gap(10, 25, 2, Reason::Link)), 0));
        coverage.take(5);
        assert_eq!((coverage.next, coverage.accepted), (30, 15));
        assert_eq!(coverage.lost[Reason::Link as usize], Lost { packets: 2, events: 15 });
        assert!(is_balanced(&coverage));
    }

    #[test]
    fn who_joins_late_or_restores_a_state_has_lost_what_came_before() {
        let mut coverage = Coverage::default();
        let before = coverage.place(9, Some(100), 1).unwrap().gap;
        assert_eq!(before, Some(gap(0, 100, 9, Reason::Down)));
        let mut lost = Coverage::default().lost;
        lost[Reason::Link as usize].events = 10;
        let mut coverage = Coverage::resumed(40, 30, lost);
        // The number of packets that contained them is not known.
        let after = coverage.place(9, Some(100), 1).unwrap().gap;
        assert_eq!(after, Some(gap(40, 100, 0, Reason::Down)));
        assert!(is_balanced(&coverage));
    }

    #[test]
    fn who_was_connected_before_a_stream_began_loses_its_first_packets_as_the_others() {
        let mut coverage = Coverage::new(Reason::Queue).connected();
        let before = coverage.place(2, Some(9), 4).unwrap().gap;
        assert_eq!(before, Some(gap(0, 9, 2, Reason::Queue)));
        let mut coverage = Coverage::new(Reason::Queue);
        assert_eq!(coverage.place(2, Some(9), 4).unwrap().gap, Some(gap(0, 9, 2, Reason::Down)));
    }

    #[test]
    fn a_source_that_numbers_packets_alone_shows_how_many_are_missing() {
        let mut coverage = Coverage::new(Reason::QueueOrLink).from_packet(7);
        assert_eq!(coverage.place(7, None, 3).unwrap().gap, None);
        coverage.take(3);
        let placed = coverage.place(10, None, 0).unwrap();
        assert_eq!((placed.gap, placed.skip), (Some(gap(3, 3, 2, Reason::QueueOrLink)), 0));
        assert_eq!(coverage.next_packet(), Some(11));
        assert!(is_balanced(&coverage));
    }

    #[test]
    fn a_packet_that_the_state_covers_in_part_is_taken_from_there() {
        let mut coverage = Coverage::resumed(40, 40, Coverage::default().lost);
        let placed = coverage.place(4, Some(35), 10).unwrap();
        assert_eq!((placed.gap, placed.skip), (None, 5));
        coverage.take(5);
        assert_eq!(coverage.next, 45);
    }

    #[test]
    fn what_the_queue_dropped_is_told_from_what_the_link_lost() {
        let mut numbers = Numbers::default();
        numbers.dropped(1);
        assert_eq!(numbers.arrived(1), Some((1, Reason::Queue)));
        numbers.dropped(2);
        assert_eq!(numbers.arrived(4), Some((2, Reason::Queue)));
        assert_eq!(numbers.arrived(7), Some((2, Reason::Link)));
        numbers.dropped(1);
        assert_eq!(numbers.arrived(10), Some((2, Reason::QueueOrLink)));
        assert_eq!(numbers.arrived(11), Some((0, Reason::Queue)));
    }

    #[test]
    fn what_was_sent_before_the_first_packet_that_arrives_was_sent_while_nobody_was_there() {
        let mut numbers = Numbers::default();
        assert_eq!(numbers.arrived(3), Some((3, Reason::Down)));
        assert_eq!(numbers.arrived(4), Some((0, Reason::Queue)));
        assert_eq!(numbers.arrived(4), None);
    }

    #[test]
    fn late_and_repeated_packets_change_nothing_but_their_count() {
        let mut coverage = Coverage::default();
        coverage.place(0, Some(0), 10).unwrap();
        coverage.take(10);
        coverage.place(2, Some(20), 10).unwrap();
        coverage.take(10);
        let known =
            |coverage: &Coverage| (coverage.next, coverage.accepted, coverage.lost, coverage.next_packet());
        let before = known(&coverage);
        assert_eq!(coverage.place(1, Some(10), 10), None);
        assert_eq!(coverage.place(2, Some(20), 10), None);
        assert_eq!((known(&coverage), coverage.late), (before, 2));
    }

    #[test]
    fn a_packet_without_events_shows_what_was_lost_at_the_end() {
        let mut coverage = Coverage::default();
        coverage.place(0, Some(0), 10).unwrap();
        coverage.take(10);
        assert_eq!(coverage.place(2, Some(30), 0).unwrap().gap, Some(gap(10, 30, 1, Reason::Link)));
        assert_eq!(coverage.place(3, Some(30), 0).unwrap().gap, None);
        assert_eq!(coverage.lose(0, Reason::Overload), gap(30, 30, 1, Reason::Overload));
        assert!(is_balanced(&coverage));
    }

    #[test]
    fn a_refused_packet_counts_once() {
        let mut coverage = Coverage::new(Reason::Queue);
        coverage.place(0, Some(0), 10).unwrap();
        coverage.take(10);
        coverage.place(1, Some(10), 5).unwrap();
        coverage.lose(5, Reason::Malformed);
        coverage.refuse();
        assert_eq!(coverage.place(2, Some(15), 5).unwrap().gap, None);
        assert_eq!(coverage.lost[Reason::Malformed as usize], Lost { packets: 2, events: 5 });
        assert_eq!(coverage.lost[Reason::Queue as usize], Lost::default());
    }

    #[test]
    fn numbers_at_the_end_of_their_range_do_not_overflow() {
        let mut coverage = Coverage::new(Reason::Link);
        coverage.place(u64::MAX, Some(u64::MAX - 1), usize::MAX).unwrap();
        coverage.take(usize::MAX);
        assert_eq!((coverage.next, coverage.next_packet()), (u64::MAX, Some(u64::MAX)));
    }
}

mod streams {
    use super::{
        AnyNetwork, Event, Gap, LEN, PacketError, Reason, Replay, Sensor, SensorEngine, frame_network,
        network, recording,
    };

    fn take(engine: &mut SensorEngine<u64>, number: usize, events: &[Event]) -> Option<Gap> {
        let first = (number * LEN) as u64;
        let push = |engine: &mut meissner_packets::AnyEngine, skip: usize| engine.push_slice(&events[skip..]);
        engine.take(number as u64, Some(first), events.len(), push).unwrap().gap
    }

    fn compare(network: &AnyNetwork) {
        let (sensor, events) = recording(20 * LEN);
        let mut engine = SensorEngine::new(network.clone(), Reason::Queue);
        let mut replay = Replay::new(network, sensor, &events).unwrap();
        assert!(engine.begin(1, sensor).unwrap() && engine.predict().unwrap().is_none());
        for (number, packet) in events.chunks(LEN).enumerate().filter(|(number, _)| number % 5 != 3) {
            assert!(!engine.begin(1, sensor).unwrap());
            if let Some(gap) = take(&mut engine, number, packet) {
                assert_eq!((gap.packets, gap.reason), (1, Reason::Queue));
                replay.lose(gap).unwrap();
            }
            let place = (engine.coverage().next, engine.coverage().accepted);
            let predicted = engine.predict().unwrap().expect("a packet was taken");
            replay.compare(place, (predicted.values, predicted.t_us, predicted.nodes as u64)).unwrap();
        }
        assert!(engine.predict().unwrap().is_none());
        assert_eq!(engine.counts().predictions, 16);
        assert_eq!(engine.outputs(), engine_outputs(network, sensor));
    }

    fn engine_outputs(network: &AnyNetwork, sensor: Sensor) -> usize {
        use meissner_engine::Predictor;
        network.engine(sensor).unwrap().predict().unwrap().values.len()
    }

    #[test]
    fn predictions_are_those_of_one_process_that_was_given_what_arrived() {
        compare(&network());
        compare(&frame_network());
    }

    #[test]
    fn another_stream_begins_with_an_empty_window_and_losses_are_summed() {
        let (sensor, events) = recording(2 * LEN);
        let mut engine = SensorEngine::new(network(), Reason::Queue);
        engine.begin(1, sensor).unwrap();
        assert_eq!(take(&mut engine, 1, &events[LEN..]).unwrap().reason, Reason::Down);
        assert!(engine.begin(2, sensor).unwrap());
        // This process was connected when the second stream began.
        assert_eq!(take(&mut engine, 1, &events[LEN..]).unwrap().reason, Reason::Queue);
        let nodes = engine.predict().unwrap().unwrap().nodes;
        assert_eq!((nodes, engine.counts().streams), (LEN, 2));
        for reason in [Reason::Down, Reason::Queue] {
            assert_eq!(engine.losses()[reason as usize].events, LEN as u64);
        }
        let refused = engine.begin(2, Sensor::new(4, 4)).unwrap_err();
        assert!(matches!(refused, PacketError::Sensor { .. }), "{refused}");
        assert!(engine.begin(3, Sensor::new(640, 480)).unwrap());
    }

    #[test]
    fn a_packet_that_cannot_be_read_is_lost_once() {
        let (sensor, events) = recording(3 * LEN);
        let mut engine = SensorEngine::new(network(), Reason::Queue);
        engine.begin(1, sensor).unwrap();
        take(&mut engine, 0, &events[..LEN]);
        assert_eq!(engine.lose(1, Some(LEN as u64), LEN), None);
        assert_eq!(take(&mut engine, 2, &events[2 * LEN..]), None);
        assert_eq!(engine.losses()[Reason::Malformed as usize].events, LEN as u64);
        assert_eq!(engine.lose(1, Some(LEN as u64), LEN), None);
        assert_eq!(engine.coverage().late, 1);
    }
}

mod live {
    use super::*;

    fn options(network: &AnyNetwork, capacity: usize, states: Option<&Path>) -> LiveOptions {
        let states = states.map(|folder| (folder.to_owned(), Duration::ZERO));
        LiveOptions { network: network.clone(), capacity, every: Duration::ZERO, states }
    }

    fn start(network: &AnyNetwork, sensor: Sensor, capacity: usize, states: Option<&Path>) -> LiveSensor {
        let started = LiveSensor::start("finger", STREAM, sensor, &options(network, capacity, states));
        let (sensor, refused) = started.unwrap();
        assert!(refused.is_none(), "{refused:?}");
        sensor
    }

    fn take(sensor: &mut LiveSensor, number: usize, events: &[Event]) -> Vec<Gap> {
        let place = (number as u64, (number * LEN) as u64, events.len());
        sensor.take(place, Some(events), [0; 2]).unwrap().collect()
    }

    /// Predicts, and compares; returns whether there was something new.
    fn predict(sensor: &mut LiveSensor, replay: &mut Replay<'_>) -> bool {
        let asked = sensor.ask(DEADLINE);
        let Some(answer) = sensor.answer(&asked, DEADLINE).unwrap() else { return false };
        let place = (answer.place.next, answer.place.accepted);
        replay.compare(place, (answer.values, answer.t_us, answer.nodes as u64)).unwrap();
        true
    }

    #[test]
    fn events_that_do_not_fit_are_dropped_as_whole_packets_and_the_others_are_predicted_on_exactly() {
        let (sensor, mut events) = recording(40 * LEN);
        // More than the queue can take.
        events.extend([events[40 * LEN - 1]; 251]);
        let network = network();
        let mut replay = Replay::new(&network, sensor, &events).unwrap();
        let mut live = start(&network, sensor, 250, None);
        let packets = events[..40 * LEN].chunks(LEN).chain([&events[40 * LEN..]]);
        for (number, packet) in packets.enumerate() {
            take(&mut live, number, packet).into_iter().for_each(|gap| replay.lose(gap).unwrap());
            if number % 8 == 7 || number == 40 {
                predict(&mut live, &mut replay);
            }
        }
        let overload = live.coverage().lost[Reason::Overload as usize];
        assert!(overload.events >= 251, "{overload:?}");
        assert_eq!(replay.end(events.len() as u64), Ok(live.coverage().accepted));
        assert_eq!(live.coverage().accepted + overload.events, events.len() as u64);
    }

    #[test]
    fn a_packet_that_cannot_be_read_is_counted_with_the_events_that_it_claims() {
        let (sensor, events) = recording(3 * LEN);
        let network = network();
        let mut replay = Replay::new(&network, sensor, &events).unwrap();
        let mut live = start(&network, sensor, 1000, None);
        take(&mut live, 0, &events[..LEN]);
        let lost: Vec<Gap> = live.take((1, LEN as u64, LEN), None, [0; 2]).unwrap().collect();
        assert_eq!(lost, [Gap { from: 100, until: 200, packets: 1, reason: Reason::Malformed }]);
        replay.lose(lost[0]).unwrap();
        take(&mut live, 2, &events[2 * LEN..]);
        assert!(predict(&mut live, &mut replay));
        assert_eq!(replay.end(300), Ok(200));
    }

    #[test]
    fn a_killed_process_goes_on_from_its_newest_state_and_has_lost_what_came_after_it() {
        for network in [network(), frame_network()] {
            kill(&network);
        }
    }

    fn kill(network: &AnyNetwork) {
        let (sensor, events) = recording(60 * LEN);
        let folder = tempfile::tempdir().unwrap();
        let mut replay = Replay::new(network, sensor, &events).unwrap();
        let mut live = start(network, sensor, 10_000, Some(folder.path()));
        let mut state = None;
        for (number, packet) in events.chunks(LEN).enumerate().take(30) {
            take(&mut live, number, packet);
            assert!(predict(&mut live, &mut replay));
            // The process is killed after its last state is written.
            if number < 20 {
                state = live.collect().or(state);
            }
        }
        let (path, state) = state.expect("a state was left");
        fs::write(path, state).unwrap();
        drop(live);

        let mut live = start(network, sensor, 10_000, Some(folder.path()));
        for (number, packet) in events.chunks(LEN).enumerate().skip(40) {
            take(&mut live, number, packet).into_iter().for_each(|gap| replay.lose(gap).unwrap());
            assert!(predict(&mut live, &mut replay));
        }
        let down = live.coverage().lost[Reason::Down as usize].events;
        assert!((2000..2200).contains(&down), "{down}");
        assert_eq!(replay.end(6000), Ok(6000 - down));
        assert!((30..=50).contains(&live.counts().0), "{}", live.counts().0);
    }

    #[test]
    fn a_process_that_ended_in_order_goes_on_without_a_gap() {
        let (sensor, events) = recording(20 * LEN);
        let (network, folder) = (network(), tempfile::tempdir().unwrap());
        let mut replay = Replay::new(&network, sensor, &events).unwrap();
        let mut live = start(&network, sensor, 10_000, Some(folder.path()));
        take(&mut live, 0, &events[..10 * LEN]);
        assert!(predict(&mut live, &mut replay));
        live.close().unwrap();
        let mut live = start(&network, sensor, 10_000, Some(folder.path()));
        let place = (1, 10 * LEN as u64, 10 * LEN);
        assert_eq!(live.take(place, Some(&events[10 * LEN..]), [0; 2]).unwrap().count(), 0);
        assert!(predict(&mut live, &mut replay));
        assert_eq!((replay.end(2000), live.counts().0), (Ok(2000), 2));
    }

    #[test]
    fn a_state_of_another_stream_is_not_used_and_a_damaged_one_is_refused() {
        let (sensor, events) = recording(LEN);
        let (network, folder) = (network(), tempfile::tempdir().unwrap());
        let mut replay = Replay::new(&network, sensor, &events).unwrap();
        let mut live = start(&network, sensor, 1000, Some(folder.path()));
        take(&mut live, 0, &events);
        assert!(predict(&mut live, &mut replay));
        live.close().unwrap();
        let options = options(&network, 1000, Some(folder.path()));
        for (stream, expected) in [(STREAM, 100), (STREAM + 1, 0)] {
            let (live, refused) = LiveSensor::start("finger", stream, sensor, &options).unwrap();
            assert_eq!((live.coverage().next, refused), (expected, None));
        }
        let path = folder.path().join("finger.state");
        let mut bytes = fs::read(&path).unwrap();
        bytes[40] ^= 1;
        for damaged in [&bytes[..], &bytes[..bytes.len() / 2], b""] {
            fs::write(&path, damaged).unwrap();
            let (live, refused) = LiveSensor::start("finger", STREAM, sensor, &options).unwrap();
            assert_eq!(live.coverage().next, 0);
            assert!(refused.is_some());
        }
    }

    #[test]
    fn a_state_of_another_network_is_refused() {
        let (sensor, events) = recording(LEN);
        let networks = [network(), frame_network()];
        for (writer, reader) in networks.iter().zip(networks.iter().rev()) {
            let folder = tempfile::tempdir().unwrap();
            let mut live = start(writer, sensor, 1000, Some(folder.path()));
            take(&mut live, 0, &events);
            live.close().unwrap();
            let options = options(reader, 1000, Some(folder.path()));
            let (_, refused) = LiveSensor::start("finger", STREAM, sensor, &options).unwrap();
            assert!(refused.is_some());
        }
    }

    #[test]
    fn a_sensor_without_the_pixels_of_the_frames_is_refused() {
        let options = options(&frame_network(), 1000, None);
        let refused = LiveSensor::start("finger", STREAM, Sensor::new(64, 64), &options).err().unwrap();
        assert!(matches!(refused, PacketError::Run(_)), "{refused}");
    }

    #[test]
    fn silence_asks_for_nothing() {
        let (sensor, events) = recording(LEN);
        let network = network();
        let mut replay = Replay::new(&network, sensor, &events).unwrap();
        let mut live = start(&network, sensor, 1000, None);
        for number in 0..100 {
            live.take((number, 0, 0), Some(&[]), [0; 2]).unwrap().for_each(drop);
        }
        assert!(!live.has_news() && !predict(&mut live, &mut replay));
        live.take((100, 0, LEN), Some(&events), [0; 2]).unwrap().for_each(drop);
        assert!(live.has_news() && predict(&mut live, &mut replay));
        for number in 101..200 {
            live.take((number, LEN as u64, 0), Some(&[]), [0; 2]).unwrap().for_each(drop);
        }
        assert!(!live.has_news() && !predict(&mut live, &mut replay));
    }

    #[test]
    fn a_prediction_is_due_when_its_time_has_come_and_there_is_news() {
        let (sensor, events) = recording(2 * LEN);
        let hour = Duration::from_hours(1);
        let options = LiveOptions { every: hour, ..options(&network(), 1000, None) };
        let (mut live, _) = LiveSensor::start("finger", STREAM, sensor, &options).unwrap();
        assert_eq!(live.until_due(), Duration::MAX);
        take(&mut live, 0, &events[..LEN]);
        assert_eq!(live.until_due(), Duration::ZERO);
        let asked = live.ask(hour);
        assert!(live.answer(&asked, hour).unwrap().is_some_and(|answer| answer.fresh));
        assert_eq!(live.until_due(), Duration::MAX);
        take(&mut live, 1, &events[LEN..]);
        assert!(live.until_due() > hour / 2 && live.until_due() < hour);
    }
}

#[test]
fn a_feed_sends_every_event_in_order_and_in_packets_of_a_bounded_size() {
    let (_, events) = recording(1000);
    for (is_live, speed) in [(false, 0.0), (false, 2.0), (true, 1.0)] {
        let (every, max_wait) = (Duration::from_micros(100), Duration::from_millis(50));
        let options = FeedOptions { is_live, speed, every, max_wait, max_events: 64 };
        let mut sent = Vec::new();
        let source: Vec<_> = events.iter().map(|&event| Ok(event)).collect();
        let send = |packet: &[Event], _| {
            assert!(packet.len() <= 64);
            sent.extend_from_slice(packet);
            Ok::<_, RunError>(())
        };
        feed(source.into_iter(), options, || false, send).unwrap();
        assert_eq!(sent, events);
    }
}

#[test]
fn a_feed_ends_with_the_fault_of_its_source_after_the_events_before_it() {
    let (_, events) = recording(10);
    for is_live in [false, true] {
        let fault = AnyNetwork::named("no such network", None).err().unwrap();
        let source: Vec<_> = events.iter().map(|&event| Ok(event)).chain([Err(fault)]).collect();
        let [every, max_wait] = [0, 50].map(Duration::from_millis);
        let options = FeedOptions { is_live, speed: 0.0, every, max_wait, max_events: 4 };
        let mut sent = 0;
        let send = |packet: &[Event], _| {
            sent += packet.len();
            Ok::<_, RunError>(())
        };
        assert!(feed(source.into_iter(), options, || false, send).is_err());
        assert_eq!(sent, 10);
    }
}
