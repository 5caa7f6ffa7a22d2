//! The node: topics, quality of service, networks.

use std::net::IpAddr;
use std::thread;
use std::time::Duration;

use futures::future::{Either, select};
use futures::{StreamExt, channel::oneshot, executor::block_on, pin_mut};
use meissner_packets::AnyNetwork;
use meissner_run::interrupt;
use meissner_run::latency::Latency;
use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, Subscription};
use rustdds::DomainParticipantBuilder;
use serde::Serialize;

use crate::Error;
use crate::error::Refused;
use crate::inference::{Inference, PacketCounts, Taken};
use crate::messages::{EventPacket, Float32MultiArray, Header, Vector3Stamped};

/// Bytes that the operating system is asked to keep for this process: a packet arrives in many
/// datagrams at once.
const RECEIVE_BUFFER: usize = 8 << 20;
/// Longest wait until an end is noticed.
const NAP: Duration = Duration::from_millis(100);
/// Predictions that are kept for a subscriber that is slow.
const PREDICTIONS: usize = 64;

/// How the node runs.
#[derive(Clone, Debug)]
pub struct Options {
    /// Domain of DDS.
    pub domain: u16,
    /// Addresses of the interfaces to use; all of them if there are none.
    pub interfaces: Vec<IpAddr>,
    /// Namespace of the node, from `/`.
    pub namespace: String,
    /// Name of the node.
    pub name: String,
    /// Topic of the packets.
    pub packets: String,
    /// Topic of the predictions.
    pub predictions: String,
    /// Whether lost packets are sent again, if the publisher does so.
    pub reliable: bool,
    /// Packets that may wait; more are lost, the oldest first.
    pub depth: usize,
}

/// Something to tell.
#[derive(Debug)]
pub enum News {
    /// The node is there, and waits.
    Ready,
    /// A publisher of packets is connected: what it sends from now on arrives, or counts as lost.
    Connected,
    /// A stream of packets begins, with this number.
    Stream(u64),
    /// So many packets are missing before the packet of this number.
    Lost(u64, u64),
    /// A packet was refused.
    Refused(Refused),
    /// A message is no packet, or a prediction is not a number or cannot be sent.
    Failed(String),
}

/// What the node did.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// What was taken and lost.
    #[serde(flatten)]
    pub counts: PacketCounts,
    /// Messages that are no packets.
    pub not_packets: u64,
    /// Predictions that no subscriber got, because one of them does not confirm any.
    pub unsent: u64,
    /// From a packet at hand until its prediction was given to DDS, in microseconds: decoding,
    /// engine, writing.
    pub packet_to_prediction_us: Latency,
    /// From the publisher's stamp of a packet until it was at hand, in microseconds, where the
    /// stamp came along: clocks of one host.
    pub publisher_to_packet_us: Latency,
}

/// Where predictions go.
enum Predictions {
    Vectors(Publisher<Vector3Stamped>),
    Arrays(Publisher<Float32MultiArray>),
}

impl Predictions {
    /// Sends a prediction for the packet of this header.
    fn send(&self, header: Header, values: &[f32]) -> Result<(), String> {
        match self {
            Self::Vectors(publisher) => {
                publisher.publish(Vector3Stamped::new(header, values)).map_err(|e| format!("{e:?}"))
            }
            Self::Arrays(publisher) => {
                publisher.publish(Float32MultiArray::new(values)).map_err(|e| format!("{e:?}"))
            }
        }
    }
}

/// A name of a topic from its text.
fn topic(what: &'static str, expected: &'static str, text: &str) -> Result<Name, Error> {
    Name::parse(text).map_err(|_| Error::Name { what, expected, found: text.to_owned() })
}

fn subscribe(node: &mut Node, options: &Options) -> Result<Subscription<EventPacket>, Error> {
    let qos = QosProfile::subscription_default().history(History::KeepLast { depth: options.depth });
    let qos = if options.reliable { qos.reliability_reliable(WhenFull::DEFAULT) } else { qos };
    let name = topic("topic of packets", "/event_camera/events", &options.packets)?;
    let kind = MessageTypeName::new("event_camera_msgs", "EventPacket");
    let topic =
        node.create_topic(&name, kind, &qos).map_err(|e| Error::ros("create the topic of packets", e))?;
    node.create_subscription(&topic, Some(qos)).map_err(|e| Error::ros("subscribe to packets", e))
}

fn advertise(node: &mut Node, options: &Options, outputs: usize) -> Result<Predictions, Error> {
    // A reliable publisher serves subscribers of both kinds. It never waits: a controller wants the
    // next prediction, not the last one.
    let qos = QosProfile::subscription_default()
        .history(History::KeepLast { depth: PREDICTIONS })
        .reliability_reliable(WhenFull::Fail);
    let name = topic("topic of predictions", "/meissner/prediction", &options.predictions)?;
    let is_vector = outputs <= Vector3Stamped::MAX;
    let kind = if is_vector {
        MessageTypeName::new("geometry_msgs", "Vector3Stamped")
    } else {
        MessageTypeName::new("std_msgs", "Float32MultiArray")
    };
    let failed = |e| Error::ros("publish predictions", e);
    let topic = node.create_topic(&name, kind, &qos).map_err(failed)?;
    Ok(if is_vector {
        Predictions::Vectors(node.create_publisher(&topic, Some(qos)).map_err(failed)?)
    } else {
        Predictions::Arrays(node.create_publisher(&topic, Some(qos)).map_err(failed)?)
    })
}

/// Takes packets and publishes predictions of `network` until the program is asked to end.
///
/// # Errors
/// The node cannot be made. A packet that is refused is no error: it is counted and told.
pub fn run(network: AnyNetwork, options: &Options, mut tell: impl FnMut(News)) -> Result<Summary, Error> {
    let builder = DomainParticipantBuilder::new(options.domain).socket_receive_buffer_size(RECEIVE_BUFFER);
    let builder = if options.interfaces.is_empty() {
        builder
    } else {
        builder.with_only_networks(options.interfaces.iter().copied())
    };
    let participant = builder.build().map_err(|e| Error::ros("join the domain", e))?;
    let context = Context::from_domain_participant(participant).map_err(|e| Error::ros("join ROS 2", e))?;
    let name = NodeName::new(&options.namespace, &options.name).map_err(|_| Error::Name {
        what: "node",
        expected: "/ and meissner",
        found: format!("{} and {}", options.namespace, options.name),
    })?;
    let about = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    let mut node =
        context.new_node(name, about).map_err(|e| Error::ros("create the node", format!("{e:?}")))?;
    // It keeps the list of nodes and topics that `ros2 node list` shows.
    let spinner = node.spinner().map_err(|e| Error::ros("run the node", e))?;
    thread::spawn(move || drop(block_on(spinner.spin())));
    let predictions = advertise(&mut node, options, network.outputs())?;
    let subscription = subscribe(&mut node, options)?;
    tell(News::Ready);

    let mut inference = Inference::new(network);
    let mut summary = Summary {
        counts: PacketCounts::default(),
        not_packets: 0,
        unsent: 0,
        packet_to_prediction_us: Latency::new(),
        publisher_to_packet_us: Latency::new(),
    };
    let mut ended = ended();
    let connected = subscription.wait_for_publisher(&node);
    pin_mut!(connected);
    let has_ended = matches!(block_on(select(connected, &mut ended)), Either::Right(_));
    if !has_ended {
        tell(News::Connected);
    }
    let packets = subscription.async_stream();
    pin_mut!(packets);
    while !has_ended && let Either::Left((Some(packet), _)) = block_on(select(packets.next(), &mut ended)) {
        let start = std::time::Instant::now();
        let (packet, about) = match packet {
            Ok(packet) => packet,
            Err(error) => {
                summary.not_packets += 1;
                tell(News::Failed(format!("a message is no packet: {error}")));
                continue;
            }
        };
        if let (Some(sent), Some(received)) = (about.source_timestamp(), about.received_timestamp()) {
            let ns = received.to_nanos().saturating_sub(sent.to_nanos());
            summary.publisher_to_packet_us.record(Duration::from_nanos(ns.max(0) as u64));
        }
        match inference.take(about.publisher_gid(), &packet) {
            Ok(Taken { is_new, lost }) => {
                if is_new {
                    tell(News::Stream(packet.seq));
                }
                if lost > 0 {
                    tell(News::Lost(lost, packet.seq));
                }
            }
            Err(refused) => {
                tell(News::Refused(refused));
                continue;
            }
        }
        match inference.predict() {
            Ok(Some(prediction)) => {
                if let Err(error) = predictions.send(packet.header, prediction.values) {
                    summary.unsent += 1;
                    tell(News::Failed(format!("a prediction was not sent: {error}")));
                }
                summary.packet_to_prediction_us.record(start.elapsed());
            }
            Ok(None) => {}
            Err(error) => tell(News::Failed(format!("no prediction: {error}"))),
        }
    }
    node.stop_spinner();
    summary.counts = inference.counts();
    Ok(summary)
}

/// Ready when the program is asked to end.
fn ended() -> oneshot::Receiver<()> {
    let (sender, receiver) = oneshot::channel();
    thread::spawn(move || {
        while !interrupt::requested() {
            interrupt::sleep(NAP);
        }
        let _ = sender.send(());
    });
    receiver
}
