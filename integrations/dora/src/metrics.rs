//! The metrics node: counts and latencies of the other nodes, in Prometheus's text format over HTTP.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use clap::Args;
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter as Total;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

use crate::http;
use crate::message::{Counter, MessageError, PredictionHeader, read_counters};
use crate::node::{Failure, Message, start};

/// Longest wait for a message.
const NAP: Duration = Duration::from_millis(100);

/// Options of the metrics node.
#[derive(Clone, Debug, Args)]
pub(crate) struct MetricsOptions {
    /// Where Prometheus asks for /metrics
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:9464")]
    listen: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OfSensor {
    sensor: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OfReason {
    sensor: String,
    reason: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OfHop {
    sensor: String,
    hop: &'static str,
}

type Totals<L> = Family<L, Total<u64, AtomicU64>>;
type Latencies = Family<OfHop, Histogram, fn() -> Histogram>;

/// Counts by sensor, with their help. A count of another name has no metric.
const BY_SENSOR: [(&str, &str); 7] = [
    ("events_sent", "Events that the source has sent"),
    ("messages_sent", "Messages that the source has sent"),
    ("events_known", "Events that the inference node has received or knows to be lost"),
    ("events_accepted", "Events that were given to the engine"),
    ("messages_late", "Messages whose events had been counted as lost, or came twice"),
    ("messages_refused", "Messages that are no events of this sensor"),
    ("predictions", "Predictions that were sent"),
];

/// Counts by sensor and reason.
const BY_REASON: [(&str, &str); 3] = [
    ("events_dropped", "Events that no engine has seen, by reason"),
    ("events_ignored", "Events that the engine was given and has no use for, by reason"),
    ("control_cycles", "Cycles of the controller, by what they had"),
];

/// The metrics, and where they are registered.
struct Metrics {
    registry: Registry,
    by_sensor: [(&'static str, Totals<OfSensor>); BY_SENSOR.len()],
    by_reason: [(&'static str, Totals<OfReason>); BY_REASON.len()],
    latencies: Latencies,
    missed: Totals<OfReason>,
}

impl Metrics {
    fn new() -> Self {
        let mut registry = Registry::with_prefix("meissner");
        let by_sensor = BY_SENSOR.map(|(name, help)| {
            let totals = Totals::default();
            registry.register(name, help, totals.clone());
            (name, totals)
        });
        let by_reason = BY_REASON.map(|(name, help)| {
            let totals = Totals::default();
            registry.register(name, help, totals.clone());
            (name, totals)
        });
        // From 50 microseconds to 1.6 seconds.
        let latencies =
            Latencies::new_with_constructor(|| Histogram::new(exponential_buckets(50e-6, 2.0, 16)));
        let help = "Time that news of a sensor takes, by hop; meaningful if the clocks of both ends agree";
        registry.register_with_unit("latency", help, Unit::Seconds, latencies.clone());
        let missed = Totals::default();
        let help = "Messages that did not reach the metrics node, by input and reason";
        registry.register("messages_missed", help, missed.clone());
        Self { registry, by_sensor, by_reason, latencies, missed }
    }

    /// Takes what a node has counted.
    fn count(&self, Counter { sensor, name, reason, value }: Counter) {
        if let Some((_, totals)) = self.by_sensor.iter().find(|(known, _)| *known == name) {
            totals.get_or_create(&OfSensor { sensor }).inner().store(value, Ordering::Relaxed);
        } else if let Some((_, totals)) = self.by_reason.iter().find(|(known, _)| *known == name) {
            totals.get_or_create(&OfReason { sensor, reason }).inner().store(value, Ordering::Relaxed);
        }
    }

    /// Takes the times of a prediction that arrived at `received_ns`.
    fn time(&self, header: &PredictionHeader, received_ns: i64) {
        let times = [header.events_sent_ns, header.events_received_ns, header.sent_ns, received_ns];
        for (hop, ends) in
            ["source_to_inference", "inference", "inference_to_metrics"].into_iter().zip(times.windows(2))
        {
            let labels = OfHop { sensor: header.sensor.clone(), hop };
            self.latencies.get_or_create(&labels).observe((ends[1] - ends[0]) as f64 / 1e9);
        }
    }

    fn take(&self, message: &Message) -> Result<(), MessageError> {
        if message.metadata.contains_key("next") {
            self.time(&PredictionHeader::read(&message.metadata)?, message.received_ns);
        } else {
            read_counters(&message.data)?.into_iter().for_each(|counter| self.count(counter));
        }
        Ok(())
    }

    fn text(&self) -> String {
        let mut text = String::new();
        encode(&mut text, &self.registry).expect("a string takes everything");
        text
    }
}

/// Runs the node until the dataflow ends.
///
/// # Errors
/// The address is taken, or the daemon cannot be reached.
pub(crate) fn run(options: &MetricsOptions) -> Result<(), Failure> {
    let metrics = Arc::new(Mutex::new(Metrics::new()));
    let shown = Arc::clone(&metrics);
    let address = options.listen.clone();
    http::serve(&options.listen, move || shown.lock().unwrap_or_else(PoisonError::into_inner).text())
        .map_err(|source| Failure::Address { address, source })?;
    let (outputs, mut inputs) = start()?;
    while !inputs.have_ended() {
        for message in inputs.take(NAP) {
            let missing = inputs.missing(&message);
            let metrics = metrics.lock().unwrap_or_else(PoisonError::into_inner);
            if let Ok(Some((messages, reason))) = missing {
                let labels = OfReason { sensor: message.input.clone(), reason: reason.name().to_owned() };
                metrics.missed.get_or_create(&labels).inc_by(messages);
            }
            if let Err(error) = missing.and_then(|_| metrics.take(&message)) {
                outputs.warn(&format!("{}: {error}", message.input));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::Metrics;
    use crate::message::Counter;

    #[test]
    fn counts_are_shown_as_they_were_last_told_and_unknown_ones_are_not() {
        let metrics = Metrics::new();
        for value in [3, 7] {
            metrics.count(Counter::new("finger", "events_sent", value));
            metrics.count(Counter::with_reason("finger", "events_dropped", "link", value));
            metrics.count(Counter::new("finger", "something", value));
        }
        let text = metrics.text();
        assert!(text.contains("meissner_events_sent_total{sensor=\"finger\"} 7\n"), "{text}");
        let dropped = "meissner_events_dropped_total{sensor=\"finger\",reason=\"link\"} 7\n";
        assert!(text.contains(dropped), "{text}");
        assert!(!text.contains("something") && text.ends_with("# EOF\n"), "{text}");
    }
}
