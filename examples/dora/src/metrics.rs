//! The metrics node: counts and latencies of the nodes in Prometheus's text format.
//!
//! One request at a time, of a bounded length and time; everything except `GET /metrics` gives 404.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, Read, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use meissner_packets::{PacketError, failed};

use crate::message::{Counter, PredictionHeader, read, read_texts};
use crate::node::{Message, start};

/// Longest wait for a message.
const NAP: Duration = Duration::from_millis(100);
/// Greatest number of bytes of a request.
const MAX_REQUEST: usize = 8192;
/// Longest wait for a part of a request, or for the reader of an answer.
const PATIENCE: Duration = Duration::from_secs(1);

/// Options of the metrics node.
#[derive(Clone, Debug, Args)]
pub(crate) struct MetricsOptions {
    /// Where Prometheus asks for /metrics
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:9464")]
    listen: String,
}

/// Counts with their help. A count of another name has no metric.
const COUNTS: [(&str, &str); 11] = [
    ("events_sent", "Events that the source has sent"),
    ("messages_sent", "Messages that the source has sent"),
    ("events_known", "Events that the inference node has received or knows to be lost"),
    ("events_accepted", "Events that were given to the engine"),
    ("messages_late", "Messages whose events had been counted as lost, or came twice"),
    ("messages_refused", "Messages that are no events of this sensor"),
    ("predictions", "Predictions that were sent"),
    ("events_dropped", "Events that no engine has seen, by reason"),
    ("events_ignored", "Events that the engine was given and has no use for, by reason"),
    ("control_cycles", "Cycles of the controller, by what they had"),
    ("messages_missed", "Messages that did not reach the metrics node, by input and reason"),
];

/// Upper bounds of the latencies' buckets: from 50 microseconds, doubling, to 1.6 seconds.
const BUCKETS: usize = 16;

/// Latencies of a hop: counts by bucket, the last for longer ones, and the sum in seconds.
#[derive(Clone, Copy, Debug, Default)]
struct Hop {
    counts: [u64; BUCKETS + 1],
    sum: f64,
}

/// The metrics so far.
#[derive(Debug, Default)]
pub(crate) struct Metrics {
    /// Counts by name, sensor and reason.
    counts: BTreeMap<(String, String, String), u64>,
    /// Latencies by sensor and hop.
    hops: BTreeMap<(String, &'static str), Hop>,
}

impl Metrics {
    /// Takes a count of a node.
    pub(crate) fn count(&mut self, Counter { sensor, name, reason, value }: Counter) {
        self.counts.insert((name, sensor, reason), value);
    }

    /// Takes the times of a prediction that arrived at `received_ns`.
    fn time(&mut self, header: &PredictionHeader, received_ns: i64) {
        let times = [header.events_sent_ns, header.events_received_ns, header.sent_ns, received_ns];
        let names = ["source_to_inference", "inference", "inference_to_metrics"];
        for (name, ends) in names.into_iter().zip(times.windows(2)) {
            let seconds = (ends[1] - ends[0]) as f64 / 1e9;
            let hop = self.hops.entry((header.sensor.clone(), name)).or_default();
            hop.counts[(0..BUCKETS).take_while(|&bucket| seconds > bound(bucket)).count()] += 1;
            hop.sum += seconds;
        }
    }

    fn take(&mut self, message: &Message) -> Result<(), PacketError> {
        if message.metadata.contains_key("next") {
            self.time(&read(&message.metadata)?, message.received_ns);
        } else {
            read_texts(&message.data)?.into_iter().for_each(|counter| self.count(counter));
        }
        Ok(())
    }

    /// The page.
    pub(crate) fn text(&self) -> Result<String, std::fmt::Error> {
        let mut text = String::new();
        for (name, help) in COUNTS {
            writeln!(text, "# HELP meissner_{name} {help}.\n# TYPE meissner_{name} counter")?;
            for ((_, sensor, reason), value) in self.counts.iter().filter(|((known, ..), _)| known == name) {
                write!(text, "meissner_{name}_total{{sensor={sensor:?}")?;
                if !reason.is_empty() {
                    write!(text, ",reason={reason:?}")?;
                }
                writeln!(text, "}} {value}")?;
            }
        }
        let help = "Time that news of a sensor takes, by hop; meaningful if the clocks of both ends agree";
        let name = "meissner_latency_seconds";
        writeln!(text, "# HELP {name} {help}.\n# TYPE {name} histogram\n# UNIT {name} seconds")?;
        for ((sensor, hop), found) in &self.hops {
            let labels = format!("sensor={sensor:?},hop={hop:?}");
            let mut sum = 0;
            for (bucket, count) in found.counts.iter().enumerate() {
                sum += count;
                let bound = if bucket < BUCKETS { bound(bucket).to_string() } else { "+Inf".to_owned() };
                writeln!(text, "{name}_bucket{{le=\"{bound}\",{labels}}} {sum}")?;
            }
            writeln!(text, "{name}_count{{{labels}}} {sum}\n{name}_sum{{{labels}}} {}", found.sum)?;
        }
        writeln!(text, "# EOF")?;
        Ok(text)
    }
}

/// Upper bound of a bucket in seconds.
fn bound(bucket: usize) -> f64 {
    50e-6 * f64::from(1_u32 << bucket)
}

/// Runs the node until the dataflow ends.
///
/// # Errors
/// The address is taken, or the daemon cannot be reached.
pub(crate) fn run(options: &MetricsOptions) -> Result<(), PacketError> {
    let metrics = Arc::new(Mutex::new(Metrics::default()));
    let shown = Arc::clone(&metrics);
    let page = move || shown.lock().unwrap_or_else(PoisonError::into_inner).text().unwrap_or_default();
    serve(&options.listen, page).map_err(failed(options.listen.clone()))?;
    let (outputs, mut inputs) = start()?;
    while !inputs.have_ended() {
        for message in inputs.take(NAP) {
            let missing = inputs.missing(&message);
            let mut metrics = metrics.lock().unwrap_or_else(PoisonError::into_inner);
            if let Ok(Some((messages, reason))) = missing {
                let labels = ("messages_missed".to_owned(), message.input.clone(), reason.name().to_owned());
                *metrics.counts.entry(labels).or_default() += messages;
            }
            if let Err(error) = missing.and_then(|_| metrics.take(&message)) {
                outputs.warn_of(&message, &error);
            }
        }
    }
    Ok(())
}

/// Serves `page` at `address` in a separate thread, as long as the process lives.
pub(crate) fn serve(address: &str, page: impl Fn() -> String + Send + 'static) -> io::Result<SocketAddr> {
    let listener = TcpListener::bind(address)?;
    let bound = listener.local_addr()?;
    thread::spawn(move || {
        for client in listener.incoming().flatten() {
            // A client that has left gets no answer; the next one is served.
            let _ = answer(client, &page);
        }
    });
    Ok(bound)
}

fn answer(mut client: TcpStream, page: impl Fn() -> String) -> io::Result<()> {
    client.set_read_timeout(Some(PATIENCE))?;
    client.set_write_timeout(Some(PATIENCE))?;
    let mut request = Vec::new();
    let mut part = [0; 1024];
    let began = Instant::now();
    let is_whole = |request: &[u8]| request.windows(4).any(|end| end == b"\r\n\r\n");
    while !is_whole(&request) && request.len() < MAX_REQUEST && began.elapsed() < PATIENCE {
        match client.read(&mut part)? {
            0 => break,
            length => request.extend_from_slice(&part[..length]),
        }
    }
    let asked = request.starts_with(b"GET /metrics ") || request.starts_with(b"GET /metrics?");
    let (status, body) = if asked { ("200 OK", page()) } else { ("404 Not Found", String::new()) };
    // The content type of OpenMetrics: the text ends with its mark.
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    );
    client.write_all(head.as_bytes())?;
    client.write_all(body.as_bytes())
}
