//! The node as a program.

use std::io::{Write, stdout};
use std::net::IpAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::{panic, process};

use clap::Parser;
use meissner_packets::AnyNetwork;
use meissner_ros2::Error;
use meissner_ros2::node::{self, News, Options};
use meissner_run::error::chain;
use meissner_run::interrupt;

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

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    // A thread of DDS that panics would leave a node that receives nothing: it ends, and who
    // started it can start it again.
    let tell_panic = panic::take_hook();
    panic::set_hook(Box::new(move |about| {
        tell_panic(about);
        process::exit(101);
    }));
    interrupt::install();
    interrupt::listen();
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", chain(&error));
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Error> {
    let Arguments {
        network,
        weights,
        packets,
        predictions,
        name,
        namespace,
        reliable,
        depth,
        interfaces,
        domain,
    } = arguments;
    let network = AnyNetwork::named(&network, weights.as_deref())?;
    let depth = depth as usize;
    let options = Options { domain, interfaces, namespace, name, packets, predictions, reliable, depth };
    let summary = node::run(network, &options, tell)?;
    let line = serde_json::to_string(&summary).map_err(|e| Error::ros("show the summary", e))?;
    writeln!(stdout(), "{line}").map_err(|e| Error::ros("show the summary", e))
}

fn tell(news: News) {
    match news {
        News::Ready => eprintln!("ready"),
        News::Connected => eprintln!("a camera is connected"),
        News::Stream(seq) => eprintln!("a stream begins with packet {seq}"),
        News::Lost(lost, seq) => eprintln!("{lost} packets lost before packet {seq}"),
        News::Refused(why) => eprintln!("a packet was refused: {}", chain(&why)),
        News::Failed(why) => eprintln!("{why}"),
    }
}
