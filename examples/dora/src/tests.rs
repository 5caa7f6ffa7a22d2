//! Messages, records and metrics, without a daemon.

mod check {
    use std::sync::OnceLock;
    use std::time::Duration;

    use meissner::{Event, Sensor};
    use meissner_packets::{AnyNetwork, LiveOptions, LiveSensor};

    use crate::check::check;
    use crate::infer::counters;
    use crate::message::{Counter, LossHeader, PredictionHeader};
    use crate::record::Line;
    use crate::source::StreamOptions;

    /// A small network, made once.
    fn network() -> AnyNetwork {
        static NETWORK: OnceLock<AnyNetwork> = OnceLock::new();
        NETWORK.get_or_init(|| AnyNetwork::named("tactigraph-past", None).unwrap()).clone()
    }

    /// The sensor and the first events of the embedded recording.
    fn recording(events: usize) -> (Sensor, Vec<Event>) {
        let (sensor, mut all) = StreamOptions { runs: 1, ..StreamOptions::default() }.recorded().unwrap();
        all.truncate(events);
        (sensor, all)
    }

    /// A record with a gap, over 1000 events of which 900 arrived.
    fn record() -> Vec<Line> {
        let (geometry, events) = recording(1000);
        let options =
            LiveOptions { network: network(), capacity: 10_000, every: Duration::ZERO, states: None };
        let (mut sensor, _) = LiveSensor::start("finger", 7, geometry, &options).unwrap();
        let (mut lines, deadline) = (Vec::new(), Duration::from_mins(2));
        for number in [0, 1, 2, 4, 5, 6, 7, 8, 9] {
            let place = (number, 100 * number, 100);
            let packet = &events[100 * number as usize..][..100];
            for gap in sensor.take(place, Some(packet), [0; 2]).unwrap() {
                let header = LossHeader { sensor: "finger".to_owned(), stream: 7, order: lines.len() as u64 };
                lines.push(Line::Loss { header, boot: 1, gap });
            }
            let asked = sensor.ask(deadline);
            let predicted = sensor.answer(&asked, deadline).unwrap().expect("news");
            let (order, place) = (lines.len() as u64, predicted.place);
            let header = PredictionHeader {
                sensor: "finger".to_owned(),
                stream: 7,
                boot: 1,
                number: order,
                order,
                next: place.next,
                accepted: place.accepted,
                t_us: predicted.t_us,
                nodes: predicted.nodes as u64,
                fresh: predicted.fresh,
                events_sent_ns: 0,
                events_received_ns: 0,
                sent_ns: 0,
            };
            lines.push(Line::Prediction { header, recorded_ns: 0, values: predicted.values.to_vec() });
        }
        let mut counters = counters(&sensor);
        counters.push(Counter::new("finger", "events_sent", 1000));
        lines.push(Line::Counters { boot: 1, counters });
        lines
    }

    fn refusal(lines: &[Line]) -> String {
        let (sensor, events) = recording(1000);
        check(lines, &network(), sensor, &events).unwrap_err().to_string()
    }

    #[test]
    fn a_complete_record_is_accepted_in_any_order_of_its_lines() {
        let (sensor, events) = recording(1000);
        let mut lines = record();
        let found = check(&lines, &network(), sensor, &events).unwrap();
        assert_eq!((found.sent, found.accepted, found.predictions), (1000, 900, 9));
        assert_eq!(found.dropped["link"], 100);
        // The last counts stay last: they are those of the end.
        let last = lines.pop().unwrap();
        lines.reverse();
        lines.push(last);
        assert_eq!(check(&lines, &network(), sensor, &events).unwrap(), found);
    }

    #[test]
    fn a_value_with_another_bit_is_found() {
        for place in [0, 8] {
            let mut lines = record();
            let predictions = lines.iter_mut().filter_map(|line| match line {
                Line::Prediction { values, .. } => Some(values),
                _ => None,
            });
            let values = predictions.into_iter().nth(place).unwrap();
            values[1] = f32::from_bits(values[1].to_bits() ^ 1);
            assert!(refusal(&lines).contains("finger: up to event"), "{}", refusal(&lines));
        }
    }

    #[test]
    fn an_event_that_nobody_accounts_for_is_found() {
        let mut lines = record();
        lines.retain(|line| !matches!(line, Line::Loss { .. }));
        assert_eq!(refusal(&lines), "finger: up to event 500: expected 500 accepted events, got 400");

        let missed = Line::Missed { input: "losses".to_owned(), messages: 1, reason: "link".to_owned() };
        lines.push(missed);
        assert!(refusal(&lines).ends_with("got 400; the record lacks messages: 1 of losses"));

        // The last prediction: no prediction covers the events after the one before, and they are
        // not dropped.
        let mut lines = record();
        lines.remove(lines.len() - 2);
        assert_eq!(refusal(&lines), "finger: expected 1000 events, of 1000, got 900");
    }

    #[test]
    fn a_wrong_count_is_found() {
        for (name, reason) in [
            ("events_sent", ""),
            ("events_known", ""),
            ("events_accepted", ""),
            ("events_dropped", "link"),
            ("events_dropped", "queue"),
        ] {
            let mut lines = record();
            let Some(Line::Counters { counters, .. }) = lines.last_mut() else {
                panic!("the counts are last")
            };
            let is_it = |counter: &&mut Counter| counter.name == name && counter.reason == reason;
            counters.iter_mut().find(is_it).unwrap().value += 1;
            assert!(refusal(&lines).contains("expected"), "{name} {reason}");
        }
        let mut lines = record();
        lines.pop();
        assert_eq!(refusal(&lines), "finger: the source has told no count");
    }

    #[test]
    fn a_sensor_of_which_only_the_source_speaks_is_found() {
        let lines = [Line::Counters { boot: 1, counters: vec![Counter::new("finger", "events_sent", 5)] }];
        assert_eq!(refusal(&lines), "finger: nothing is said of its 5 events");
    }
}

mod message {
    use dora_node_api::{DoraArray, Parameter};
    use meissner::{Event, Sensor};
    use meissner_packets::{Gap, Reason};

    use crate::message::{
        Counter, EventsHeader, PredictionHeader, Stamp, events_array, metadata, read, read_events,
        read_texts, read_values, texts_array, values_array,
    };

    #[test]
    fn what_was_written_is_read_back_with_every_bit() {
        let events = [Event::new(i64::MIN, 0, u16::MAX, true), Event::new(7, 3, 4, false)];
        let mut found = Vec::new();
        read_events(&DoraArray::from(events_array(&events)), &mut found).unwrap();
        assert_eq!(found, events);
        read_events(&DoraArray::from(events_array(&[])), &mut found).unwrap();
        assert_eq!(found.len(), 2);

        let values = [f32::MIN_POSITIVE / 2.0, -0.0, 1.0 + f32::EPSILON];
        let found = read_values(&DoraArray::from(values_array(&values))).unwrap();
        assert_eq!(found.map_bits(), values.to_vec().map_bits());

        let gap = Gap { from: 3, until: u64::MAX, packets: 2, reason: Reason::Link };
        assert_eq!(read_texts::<Gap>(&DoraArray::from(texts_array(&[gap]))).unwrap(), [gap]);
        let counters =
            [Counter::new("a", "predictions", 4), Counter::with_reason("b", "events_dropped", "queue", 5)];
        assert_eq!(read_texts::<Counter>(&DoraArray::from(texts_array(&counters))).unwrap(), counters);

        let header = PredictionHeader {
            sensor: "finger".to_owned(),
            stream: 5,
            boot: 6,
            number: 7,
            order: 8,
            next: 9,
            accepted: 8,
            t_us: None,
            nodes: 3,
            fresh: true,
            events_sent_ns: 1,
            events_received_ns: 2,
            sent_ns: 3,
        };
        let mut entries = metadata(&header);
        entries.extend(metadata(&Stamp { boot: 6, number: 7, sent_ns: 3 }));
        assert_eq!(read::<PredictionHeader>(&entries).unwrap(), header);
    }

    trait MapBits {
        fn map_bits(self) -> Vec<u32>;
    }

    impl MapBits for Vec<f32> {
        fn map_bits(self) -> Vec<u32> {
            self.into_iter().map(f32::to_bits).collect()
        }
    }

    #[test]
    fn what_is_no_message_of_events_is_refused_with_what_was_expected() {
        let mut entries: dora_node_api::MetadataParameters = [("first", 3), ("width", 5)]
            .map(|(key, value)| (key.to_owned(), Parameter::Integer(value)))
            .into();
        let refused = meissner_run::error::chain(&read::<EventsHeader>(&entries).unwrap_err());
        assert_eq!(refused, "metadata: missing field `height`");
        for (height, fits) in [(0, false), (-1, false), (65_536, false), (65_535, true)] {
            entries.insert("height".to_owned(), Parameter::Integer(height));
            let header = read::<EventsHeader>(&entries);
            assert_eq!(header.is_ok(), fits, "{header:?}");
        }
        assert_eq!(read::<EventsHeader>(&entries).unwrap().sensor(), Sensor::new(5, 65_535));

        let floats = DoraArray::from(values_array(&[1.0]));
        let mut events = Vec::new();
        assert!(read_events(&floats, &mut events).is_err());
        let counters = DoraArray::from(texts_array::<Counter>(&[]));
        assert!(read_events(&counters, &mut events).is_err());
        assert!(read_values(&counters).is_err());
    }
}

mod control {
    use crate::control::ControlOptions;

    #[test]
    fn a_turn_is_a_share_of_the_prediction_within_the_limit_and_what_is_no_pair_of_angles_turns_nothing() {
        let law = ControlOptions { gain: 0.5, limit: 0.1, period_ms: 10, deadline_ms: 5, oldest_ms: 100 };
        assert_eq!(law.turn(&[0.125, -0.0625]), [0.0625, -0.03125]);
        assert_eq!(law.turn(&[7.0, -7.0]), [0.1, -0.1]);
        for predicted in [&[][..], &[0.1], &[0.1, 0.1, 0.1], &[f32::NAN, 0.1], &[0.1, f32::INFINITY]] {
            assert_eq!(law.turn(predicted), [0.0; 2]);
        }
    }
}

mod metrics {
    use std::io::{Read, Write};
    use std::net::TcpStream;

    use crate::message::Counter;
    use crate::metrics::{Metrics, serve};

    fn ask(address: std::net::SocketAddr, request: &[u8]) -> String {
        let mut client = TcpStream::connect(address).unwrap();
        client.write_all(request).unwrap();
        let mut answer = String::new();
        client.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn the_page_is_served_and_nothing_else() {
        let address = serve("127.0.0.1:0", || "text".to_owned()).unwrap();
        let answer = ask(address, b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n");
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.ends_with("\r\n\r\ntext"), "{answer}");
        for request in [&b"GET / HTTP/1.1\r\n\r\n"[..], b"\r\n\r\n", b"POST /metrics HTTP/1.1\r\n\r\n"] {
            assert!(ask(address, request).starts_with("HTTP/1.1 404 "));
        }
        // A silent client does not block the others without end.
        let _silent = TcpStream::connect(address).unwrap();
        assert!(ask(address, b"GET /metrics HTTP/1.1\r\n\r\n").ends_with("text"));
    }

    #[test]
    fn counts_are_shown_as_they_were_last_told_and_unknown_ones_are_not() {
        let mut metrics = Metrics::default();
        for value in [3, 7] {
            metrics.count(Counter::new("finger", "events_sent", value));
            metrics.count(Counter::with_reason("finger", "events_dropped", "link", value));
            metrics.count(Counter::new("finger", "something", value));
        }
        let text = metrics.text().unwrap();
        assert!(text.contains("meissner_events_sent_total{sensor=\"finger\"} 7\n"), "{text}");
        let dropped = "meissner_events_dropped_total{sensor=\"finger\",reason=\"link\"} 7\n";
        assert!(text.contains(dropped), "{text}");
        assert!(!text.contains("something") && text.ends_with("# EOF\n"), "{text}");
    }
}

mod record {
    use crate::message::PredictionHeader;
    use crate::record::{Line, output};

    #[test]
    fn a_line_is_read_back_with_the_bits_of_its_values() {
        let header = PredictionHeader {
            sensor: "finger".to_owned(),
            stream: 1,
            boot: 2,
            number: 3,
            order: 4,
            next: 5,
            accepted: 5,
            t_us: Some(6),
            nodes: 7,
            fresh: false,
            events_sent_ns: 8,
            events_received_ns: 9,
            sent_ns: 10,
        };
        // A value of each exponent, with an odd mantissa.
        let values = (0..255_u32).map(|exponent| f32::from_bits(exponent << 23 | 0x2a_aaab)).collect();
        let line = Line::Prediction { header, recorded_ns: 11, values };
        let text = serde_json::to_string(&line).unwrap();
        assert_eq!(serde_json::from_str::<Line>(&text).unwrap(), line);
        assert!(text.starts_with(r#"{"kind":"prediction","sensor":"finger""#), "{text}");
    }

    #[test]
    fn several_inputs_of_a_kind_have_names_with_a_dash() {
        assert_eq!(["counters", "counters-source", "losses"].map(output), ["counters", "counters", "losses"]);
    }
}

mod source {
    use meissner::Event;

    use crate::source::{PAUSE_US, repeated};

    #[test]
    fn the_times_of_a_second_run_go_on_after_a_pause() {
        let events = [Event::new(5, 1, 1, true), Event::new(25, 2, 2, false)];
        let times: Vec<_> = repeated(&events, 3).iter().map(|event| event.t_us).collect();
        let later = 20 + PAUSE_US;
        assert_eq!(times, [5, 25, 5 + later, 25 + later, 5 + 2 * later, 25 + 2 * later]);
        assert!(repeated(&[], 3).is_empty() && repeated(&events, 0).is_empty());
    }
}
