//! Bytes that arrive on a socket, through all steps of `meissner run` except printing.

use std::error::Error;
use std::io::{self, BufReader, Read, Write};
use std::net::UdpSocket;
use std::path::Path;
use std::sync::LazyLock;
use std::thread;

use meissner_engine::{Engine, Event, Sensor};
use meissner_io::{Format, IoError, LiveEvents, ReadOptions};
use meissner_run::model::{Model, ModelOptions};
use meissner_run::run::{EventRun, Observer, Prediction, RunOptions};
use meissner_run::schedule::Every;
use meissner_run::source::Source;

use crate::Verdict;

const SENSOR: Sensor = Sensor { width: 34, height: 34 };
/// More datagrams might not fit in the buffer of a socket.
const MAX_DATAGRAMS: usize = 64;

static MODEL: LazyLock<Model> = LazyLock::new(|| {
    let network = "digits-past".to_owned();
    let options = ModelOptions { network, capacity: Some(64), ..ModelOptions::default() };
    Model::load(&options).expect("a shipped network")
});

/// The events of a run, and its last prediction.
#[derive(Debug, Default)]
struct Seen {
    events: Vec<Event>,
    value: Vec<f32>,
}

impl Observer for Seen {
    fn prediction(&mut self, prediction: &Prediction<'_>) -> io::Result<()> {
        if let Prediction::Events(prediction) = prediction {
            self.value = prediction.value.0.to_vec();
        }
        Ok(())
    }

    fn event(&mut self, _: usize, event: Event) {
        self.events.push(event);
    }
}

/// Gives one datagram at each read.
struct Datagrams<I>(I);

impl<'a, I: Iterator<Item = &'a [u8]>> Read for Datagrams<I> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.next().unwrap_or_default().read(bytes)
    }
}

/// Bytes over a connection or in datagrams, as their first byte chooses: a run ends, takes the
/// events that a reader of the same bytes finds, and predicts the same as an engine with these
/// events.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn socket(bytes: &[u8]) -> Verdict {
    let Some((&choice, bytes)) = bytes.split_first() else { return Verdict::Refused };
    let length = 1 + usize::from(choice) * 8;
    let datagrams = || bytes.chunks(length).take(MAX_DATAGRAMS);
    let options = match choice % 5 {
        0 | 1 => ReadOptions::default(),
        2 => ReadOptions::from(Format::Evt2),
        3 => ReadOptions::from(Format::Evt3),
        _ => ReadOptions::from(Format::Aedat4),
    };
    let options = options.sensor(SENSOR);
    let (ended, items): (_, Vec<Result<Event, IoError>>) = match (choice % 5, options.format) {
        (0, _) => {
            let input = BufReader::with_capacity(1 << 16, Datagrams(datagrams()));
            (in_datagrams(datagrams(), &options), LiveEvents::of_datagrams(input, options.text).collect())
        }
        (_, None) => (over_connection(bytes, &options), LiveEvents::new(bytes, options.text).collect()),
        (_, Some(format)) => {
            let events = LiveEvents::raw(bytes, format, options).expect("a raw format");
            (over_connection(bytes, &options), events.collect())
        }
    };
    let (seen, failed) = ended;
    let expected: Vec<Event> = items.iter().flatten().copied().collect();
    assert!(expected.starts_with(&seen.events), "{expected:?}, taken were {:?}", seen.events);
    assert!(failed || seen.events.len() == expected.len(), "{} of {}", seen.events.len(), expected.len());
    let mut engine = Engine::new(MODEL.network.clone(), SENSOR).expect("a sensor");
    engine.push_slice(&seen.events);
    // Held events are those for which only later ones could decide whether the clock has restarted.
    if !failed && engine.held().is_empty() {
        let found = engine.predict().expect("finite weights").values;
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(found), bits(&seen.value), "{found:?}, the run predicted {:?}", seen.value);
    }
    if items.iter().all(Result::is_ok) { Verdict::Accepted } else { Verdict::Refused }
}

/// A server, and its address. It is local if possible: the ports of TCP stay unusable for a minute
/// after a connection, and there are not enough of them.
#[cfg(unix)]
fn server(folder: &Path) -> (std::os::unix::net::UnixListener, String) {
    let path = folder.join("socket");
    (std::os::unix::net::UnixListener::bind(&path).expect("a server"), format!("tcp://{}", path.display()))
}

#[cfg(not(unix))]
fn server(_: &Path) -> (std::net::TcpListener, String) {
    let server = std::net::TcpListener::bind("127.0.0.1:0").expect("a server");
    let address = format!("tcp://{}", server.local_addr().expect("its address"));
    (server, address)
}

/// The events that a run reads from these bytes, and whether it ends with an error.
fn over_connection(bytes: &[u8], options: &ReadOptions) -> (Seen, bool) {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let (server, address) = server(folder.path());
    thread::scope(|scope| {
        scope.spawn(|| {
            let (mut client, _) = server.accept().expect("the run connects");
            // A run that has enough closes the connection.
            let _ = client.write_all(bytes);
        });
        run(Source::open(Some(Path::new(&address)), options, true, false).expect("the server listens"))
    })
}

/// The same of these datagrams, and an empty one, which ends the stream.
fn in_datagrams<'a>(datagrams: impl Iterator<Item = &'a [u8]>, options: &ReadOptions) -> (Seen, bool) {
    let sender = UdpSocket::bind("127.0.0.1:0").expect("a port");
    // Another program may take a free port before it is opened.
    let opened = || {
        let free = UdpSocket::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a port");
        let source = Source::open(Some(Path::new(&format!("udp://{free}"))), options, true, false);
        source.ok().map(|source| (free, source))
    };
    let (free, source) = (0..100).find_map(|_| opened()).expect("a port");
    for datagram in datagrams.chain([&[][..]]) {
        sender.send_to(datagram, free).expect("the source listens");
    }
    run(source)
}

fn run(source: Source) -> (Seen, bool) {
    let mut seen = Seen::default();
    let options = RunOptions { every: Some(Every::End), ..RunOptions::default() };
    let run = EventRun::new(&MODEL, source, SENSOR, options).expect("a sensor");
    let failed = match run.run(&mut seen).result {
        Ok(()) => false,
        Err(error) => {
            let causes = std::iter::successors(Some(&error as &dyn Error), |&error| error.source());
            let message: Vec<_> = causes.map(ToString::to_string).collect();
            assert!(message.concat().contains("expected"), "{message:?}");
            true
        }
    };
    (seen, failed)
}
