//! Tests of the streams on which events arrive, and of the limits of their reader.

mod source {
    use crate::source::Source;
    use meissner_io::ReadOptions;

    #[test]
    fn every_so_many_events_are_those_of_step_by_and_are_counted_beforehand() {
        let all: Vec<_> =
            Source::open(None, &ReadOptions::default(), false, true).unwrap().map(Result::unwrap).collect();
        for stride in [1, 2, 7, all.len(), all.len() + 1] {
            let source = Source::open(None, &ReadOptions::default(), false, true).unwrap().every(stride);
            assert_eq!(source.recorded(), Some(all.len() as u64));
            let expected: Vec<_> = all.iter().copied().step_by(stride).collect();
            assert_eq!(source.remaining(), Some(expected.len() as u64));
            assert_eq!(source.map(Result::unwrap).collect::<Vec<_>>(), expected);
        }
    }
}

mod streams {
    use std::io::{BufReader, Read};
    use std::path::Path;

    use crate::streams::{DatagramLines, Stream, is_live, stream};

    #[test]
    fn a_line_ends_with_its_datagram() {
        /// A datagram at each read.
        struct Datagrams(Vec<Vec<u8>>);

        impl Read for Datagrams {
            fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
                if self.0.is_empty() { Ok(0) } else { self.0.remove(0).as_slice().read(bytes) }
            }
        }

        let sent = ["1,2\n3", "4,5\n\n", &"6".repeat(5_000), "7"].map(|text| text.as_bytes().to_vec());
        let input = BufReader::with_capacity(1 << 16, Datagrams(sent.to_vec()));
        let mut text = String::new();
        let mut lines = DatagramLines::new(input);
        lines.read_to_string(&mut text).expect("it is text");
        assert_eq!(text, "1,2\n3\n4,5\n\na line that is too long\n7\n");
    }

    #[test]
    fn a_scheme_names_a_stream_and_anything_else_is_a_file() {
        for (name, expected) in [
            ("-", Some(Stream::Stdin)),
            ("tcp://localhost:5000", Some(Stream::Connect("localhost:5000"))),
            ("tcp-listen://0.0.0.0:5000", Some(Stream::Listen("0.0.0.0:5000"))),
            ("udp://[::]:5000", Some(Stream::Datagrams("[::]:5000"))),
            ("dv://localhost:7777", Some(Stream::DvConnect("localhost:7777"))),
            ("dv:///tmp/camera", Some(Stream::DvConnect("/tmp/camera"))),
            ("dv-listen://[::]:7777", Some(Stream::DvListen("[::]:7777"))),
            ("http://x", None),
            ("a.csv", None),
            ("./-", None),
        ] {
            assert_eq!((stream(Path::new(name)), is_live(Path::new(name))), (expected, expected.is_some()));
        }
    }
}

mod press {
    use meissner_engine::{Engine, Event, Sensor};
    use meissner_models::{Description, Weights};

    use crate::press::{Press, truth};
    use crate::source::embedded;

    const SENSOR: Sensor = Sensor { width: 346, height: 260 };

    /// The angles that `tactigraph-past` predicts at the end of the press, in degrees, and the
    /// number of events that its filter drops, if each of `pixels` sends `rate` more events per
    /// second. Without `filters`, the network has no filter.
    fn angles_with_hot_pixels(rate: i64, pixels: &[(u16, u16)], filters: bool) -> ([f64; 2], u64) {
        let press = Press::embedded().expect("it can be read");
        let mut events = embedded().expect("it can be read").events;
        events.retain(|event| event.t_us <= press.end_us);
        let more = (press.end_us - press.first_us) * rate / 1_000_000;
        for &(x, y) in pixels {
            let times = (0..more).map(|i| press.first_us + i * 1_000_000 / rate);
            events.extend(times.map(|t_us| Event::new(t_us, x, y, t_us % 2 == 0)));
        }
        events.sort_by_key(|event| event.t_us);
        let description = Description::shipped("tactigraph-past").expect("it is shipped");
        let weights = Weights::shipped("tactigraph-past").expect("they are shipped");
        let mut network = description.network(&weights).expect("they fit");
        if !filters {
            network = network.with_filters([]).expect("none");
        }
        let mut engine = Engine::new(network, SENSOR).expect("the sensor has pixels");
        engine.push_slice(&events);
        let found = engine.predict().expect("numbers").values;
        let found = [found[0], found[1]].map(|value| f64::from(value).to_degrees());
        (found, engine.event_counters().filtered)
    }

    #[test]
    fn a_hot_pixel_of_any_rate_moves_the_angles_by_less_than_0_3_degrees() {
        let moved = |rate, pixels: &[(u16, u16)], filters| {
            let ([roll, pitch], _) = angles_with_hot_pixels(1, &[], false);
            let (found, filtered) = angles_with_hot_pixels(rate, pixels, filters);
            ((found[0] - roll).abs().max((found[1] - pitch).abs()), filtered)
        };
        assert_eq!(moved(1, &[], true), (0.0, 0), "the filter drops nothing of the press");
        let (most, _) = moved(16_000, &[(173, 130)], false);
        assert!(most > 5.0, "the network sums over events: {most} degrees");
        // Rates below the filter's rate, just above it, and far above; in the contact and next to
        // it.
        for rate in [95, 110, 1_000, 16_000, 200_000] {
            for pixels in [&[(173, 130)][..], &[(20, 20)], &[(173, 130), (100, 90), (250, 180)]] {
                let (most, filtered) = moved(rate, pixels, true);
                assert!(most < 0.3, "{rate} events per second of {pixels:?}: {most} degrees");
                assert!(rate < 1_000 || filtered > 0, "{rate} events per second of {pixels:?}");
            }
        }
    }

    #[test]
    fn the_embedded_press_has_events_while_the_dome_moves_and_constant_angles() {
        let press = Press::embedded().expect("it can be read");
        let events = embedded().expect("it can be read").events;
        assert_eq!(events[0].t_us, press.first_us);
        let between = |from, to| events.iter().filter(|event| (from..to).contains(&event.t_us)).count();
        let [pressed, held] =
            [between(press.contact_us, press.end_us), between(press.end_us + 5_000, press.end_us + 60_000)];
        let lifted = between(press.end_us + 60_000, i64::MAX);
        assert!(pressed > 10_000 && held < 500 && lifted > 10_000, "{pressed}, {held}, {lifted}");
        let tilt = press.angles[0].hypot(press.angles[1]).to_degrees();
        assert!((tilt - 6.0).abs() < 0.01, "{tilt}");
        let rows = truth();
        assert!(rows.windows(2).all(|pair| {
            let [(before, [depth, ..]), (after, [next, ..])] = pair else { return false };
            before < after && (depth <= next || *before > press.end_us)
        }));
        assert!(rows.iter().all(|(_, row)| row[1..] == press.angles));
    }
}

mod output {
    use std::io::{Read, Write, pipe};
    use std::os::unix::net::UnixStream;
    use std::thread;

    use crate::interrupt::output;

    #[test]
    fn a_slow_reader_gets_every_byte_in_order_from_a_pipe_and_from_a_socket() {
        let bytes: Vec<u8> = (0..300_000_u32).map(|i| (i % 251) as u8).collect();
        let slow = |mut from: Box<dyn Read + Send>| {
            thread::spawn(move || {
                let (mut all, mut part) = (Vec::new(), [0; 5_000]);
                while let Ok(read @ 1..) = from.read(&mut part) {
                    all.extend_from_slice(&part[..read]);
                    thread::yield_now();
                }
                all
            })
        };
        let (reader, writer) = pipe().expect("there are pipes");
        let read = slow(Box::new(reader));
        output(writer).write_all(&bytes).expect("it is read");
        assert!(read.join().expect("it reads") == bytes);
        let (reader, writer) = UnixStream::pair().expect("there are sockets");
        let read = slow(Box::new(reader));
        output(writer).write_all(&bytes).expect("it is read");
        assert!(read.join().expect("it reads") == bytes);
    }

    #[test]
    fn a_reader_who_is_gone_is_an_error_and_a_closed_file_too() {
        let (reader, writer) = pipe().expect("there are pipes");
        drop(reader);
        let error = output(writer).write_all(b"x").expect_err("nobody reads");
        assert_eq!(error.kind(), std::io::ErrorKind::BrokenPipe);
    }
}
