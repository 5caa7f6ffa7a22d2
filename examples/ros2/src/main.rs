//! A ROS 2 node that takes packets of an event camera and publishes predictions. It speaks the
//! protocol of ROS 2 (DDS) itself: neither building nor running it needs a ROS installation.
//!
//! `inference` turns packets into predictions with `meissner_packets`, `messages` has the messages
//! of ROS 2; topics and quality of service are here.

mod inference;
mod messages;

use std::fmt::Display;
use std::net::IpAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use std::{panic, process, thread};

use clap::Parser;
use futures::future::{Either, select};
use futures::{StreamExt, channel::oneshot, executor::block_on, pin_mut};
use meissner_packets::{AnyNetwork, PacketError, failed};
use meissner_run::error::chain;
use meissner_run::interrupt;
use meissner_run::latency::Latency;
use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, Subscription};
use rustdds::DomainParticipantBuilder;
use serde::Serialize;

use crate::inference::{Inference, PacketCounts};
use crate::messages::{EventPacket, Float32MultiArray, Header, Vector3Stamped};

/// Bytes of the socket's buffer: a packet arrives in many datagrams at once.
const RECEIVE_BUFFER: usize = 8 << 20;
/// Longest wait until an end is noticed.
const NAP: Duration = Duration::from_millis(100);
/// Number of predictions that are kept for a slow subscriber.
const PREDICTIONS: usize = 64;

/// A ROS 2 node: packets of an event camera in, predictions out
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Shipped network over events or frames of them, or file of a description
    #[arg(default_value = "tactigraph-past")]
    network: String,
    /// File with weights, instead of the shipped ones
    #[arg(long)]
    weights: Option<PathBuf>,
    /// Topic of the packets (event_camera_msgs/msg/EventPacket)
    #[arg(long, default_value = "/event_camera/events")]
    packets: String,
    /// Topic of the predictions (geometry_msgs/msg/Vector3Stamped; std_msgs/msg/Float32MultiArray
    /// for more than three values)
    #[arg(long, default_value = "/meissner/prediction")]
    predictions: String,
    /// Name of the node
    #[arg(long, default_value = "meissner")]
    name: String,
    /// Namespace of the node
    #[arg(long, default_value = "/")]
    namespace: String,
    /// Have lost packets sent again; the publisher must be reliable too
    #[arg(long)]
    reliable: bool,
    /// Packets that may wait; where there are more, the oldest are lost
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    depth: u32,
    /// Use only the interface of this address, such as 127.0.0.1; may be given several times
    #[arg(long = "interface", value_name = "ADDRESS")]
    interfaces: Vec<IpAddr>,
    /// Domain of DDS
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: u16,
}

/// The results of the node.
#[derive(Debug, Default, Serialize)]
struct Summary {
    #[serde(flatten)]
    counts: PacketCounts,
    /// Messages that are not packets.
    not_packets: u64,
    /// Predictions that no subscriber got, because one of the subscribers does not confirm any.
    unsent: u64,
    /// From the arrival of a packet until its prediction was given to DDS, in microseconds.
    packet_to_prediction_us: Latency,
    /// From a packet's stamp to its arrival, in microseconds: clocks of one host.
    publisher_to_packet_us: Latency,
}

/// The publisher of predictions.
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

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    // If a thread of DDS panics, the node would receive nothing more. Therefore it ends.
    let tell_panic = panic::take_hook();
    panic::set_hook(Box::new(move |about| {
        tell_panic(about);
        process::exit(101);
    }));
    interrupt::install();
    interrupt::listen();
    match run(&arguments) {
        Ok(summary) => {
            println!("{}", serde_json::to_string(&summary).expect("counts are written without errors"));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {}", chain(&error));
            ExitCode::FAILURE
        }
    }
}

/// A step of ROS 2 that fails.
fn ros<E: Display>(step: &str) -> impl FnOnce(E) -> PacketError {
    let step = format!("cannot {step}");
    move |error| failed(step)(error.to_string())
}

/// A name of a topic from its text.
fn topic(what: &str, example: &str, text: &str) -> Result<Name, PacketError> {
    let expected = || format!("a name of ROS 2 such as {example}");
    Name::parse(text).map_err(|_| PacketError::unexpected(what, &expected(), text))
}

fn subscribe(node: &mut Node, options: &Arguments) -> Result<Subscription<EventPacket>, PacketError> {
    let depth = options.depth as usize;
    let qos = QosProfile::subscription_default().history(History::KeepLast { depth });
    let qos = if options.reliable { qos.reliability_reliable(WhenFull::DEFAULT) } else { qos };
    let name = topic("topic of packets", "/event_camera/events", &options.packets)?;
    let kind = MessageTypeName::new("event_camera_msgs", "EventPacket");
    let topic = node.create_topic(&name, kind, &qos).map_err(ros("create the topic of packets"))?;
    node.create_subscription(&topic, Some(qos)).map_err(ros("subscribe to packets"))
}

fn advertise(node: &mut Node, options: &Arguments, outputs: usize) -> Result<Predictions, PacketError> {
    // A reliable publisher serves subscribers of both kinds. It never waits.
    let qos = QosProfile::subscription_default()
        .history(History::KeepLast { depth: PREDICTIONS })
        .reliability_reliable(WhenFull::Fail);
    let name = topic("topic of predictions", "/meissner/prediction", &options.predictions)?;
    let is_vector = outputs <= Vector3Stamped::MAX;
    let (package, kind) =
        if is_vector { ("geometry_msgs", "Vector3Stamped") } else { ("std_msgs", "Float32MultiArray") };
    let step = "publish predictions";
    let topic = node.create_topic(&name, MessageTypeName::new(package, kind), &qos).map_err(ros(step))?;
    Ok(if is_vector {
        Predictions::Vectors(node.create_publisher(&topic, Some(qos)).map_err(ros(step))?)
    } else {
        Predictions::Arrays(node.create_publisher(&topic, Some(qos)).map_err(ros(step))?)
    })
}

/// Takes packets and publishes predictions until the program is asked to end. A refused packet is
/// not an error: it is counted and reported.
fn run(options: &Arguments) -> Result<Summary, PacketError> {
    let network = AnyNetwork::named(&options.network, options.weights.as_deref())?;
    let mut builder =
        DomainParticipantBuilder::new(options.domain).socket_receive_buffer_size(RECEIVE_BUFFER);
    if !options.interfaces.is_empty() {
        builder = builder.with_only_networks(options.interfaces.iter().copied());
    }
    let participant = builder.build().map_err(ros("join the domain"))?;
    let context = Context::from_domain_participant(participant).map_err(ros("join ROS 2"))?;
    let name = NodeName::new(&options.namespace, &options.name).map_err(|_| {
        let found = format!("{} and {}", options.namespace, options.name);
        PacketError::unexpected("node", "a name of ROS 2 such as / and meissner", &found)
    })?;
    let about = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    let made = context.new_node(name, about).map_err(|error| format!("{error:?}"));
    let mut node = made.map_err(ros("create the node"))?;
    // The spinner keeps the list of nodes and topics that `ros2 node list` shows.
    let spinner = node.spinner().map_err(ros("run the node"))?;
    thread::spawn(move || drop(block_on(spinner.spin())));
    let predictions = advertise(&mut node, options, network.outputs())?;
    let subscription = subscribe(&mut node, options)?;
    eprintln!("ready");

    let (mut inference, mut summary) = (Inference::new(network), Summary::default());
    let mut ended = ended();
    let connected = subscription.wait_for_publisher(&node);
    pin_mut!(connected);
    let has_ended = matches!(block_on(select(connected, &mut ended)), Either::Right(_));
    if !has_ended {
        // Its packets from now on arrive, or count as lost.
        eprintln!("a camera is connected");
    }
    let packets = subscription.async_stream();
    pin_mut!(packets);
    while !has_ended && let Either::Left((Some(packet), _)) = block_on(select(packets.next(), &mut ended)) {
        let start = Instant::now();
        let (packet, about) = match packet {
            Ok(packet) => packet,
            Err(error) => {
                summary.not_packets += 1;
                eprintln!("a message is no packet: {error}");
                continue;
            }
        };
        if let (Some(sent), Some(received)) = (about.source_timestamp(), about.received_timestamp()) {
            let ns = received.to_nanos().saturating_sub(sent.to_nanos());
            summary.publisher_to_packet_us.record(Duration::from_nanos(ns.max(0) as u64));
        }
        match inference.take(about.publisher_gid(), &packet) {
            Ok(taken) => {
                if taken.is_new {
                    eprintln!("a stream begins with packet {}", packet.seq);
                }
                if taken.lost > 0 {
                    eprintln!("{} packets lost before packet {}", taken.lost, packet.seq);
                }
            }
            Err(refused) => {
                eprintln!("a packet was refused: {}", chain(&refused));
                continue;
            }
        }
        match inference.predict() {
            Ok(Some(prediction)) => {
                if let Err(error) = predictions.send(packet.header, prediction.values) {
                    summary.unsent += 1;
                    eprintln!("a prediction was not sent: {error}");
                }
                summary.packet_to_prediction_us.record(start.elapsed());
            }
            Ok(None) => {}
            Err(error) => eprintln!("no prediction: {error}"),
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
