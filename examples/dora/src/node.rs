//! A node of a dataflow: numbered messages out, numbered messages in.

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use dora_node_api::arrow_v59::array::ArrayRef;
use dora_node_api::dora_core::config::DataId;
use dora_node_api::{DoraArray, DoraNode, Event, EventStream, MetadataParameters, NodeError};
use meissner_packets::{Numbers, PacketError, Reason, now_ns};
use serde::Serialize;
use thiserror::Error;

use crate::message::{MessageError, Stamp, metadata, read};

/// A node cannot go on.
#[derive(Debug, Error)]
pub(crate) enum Failure {
    /// The daemon refuses the node, or an output.
    #[error("the node's daemon")]
    Dora(#[from] NodeError),
    /// A network or a recording cannot be used.
    #[error(transparent)]
    Run(#[from] meissner_run::RunError),
    /// An engine cannot go on.
    #[error("sensor {sensor}")]
    Sensor { sensor: String, source: Box<PacketError> },
    /// A file cannot be used.
    #[error("{path}")]
    File { path: String, source: std::io::Error },
    /// An address cannot be listened at.
    #[error("{address}")]
    Address { address: String, source: std::io::Error },
    /// A line of a record cannot be read.
    #[error("line {line} of the record")]
    Record { line: usize, source: serde_json::Error },
    /// A record is not what it should be.
    #[error("{0}")]
    Check(String),
}

/// The side of a node that sends.
pub(crate) struct Outputs {
    node: DoraNode,
    boot: i64,
    numbers: BTreeMap<&'static str, u64>,
}

/// The node that the daemon has started this process for.
///
/// # Errors
/// No daemon has, or it cannot be reached.
pub(crate) fn start() -> Result<(Outputs, Inputs), Failure> {
    let (node, events) = DoraNode::init_from_env()?;
    let outputs = Outputs { node, boot: now_ns(), numbers: BTreeMap::new() };
    Ok((outputs, Inputs { events, has_ended: false, numbers: HashMap::new() }))
}

impl Outputs {
    /// When this node started: the name of its life.
    pub(crate) fn boot(&self) -> i64 {
        self.boot
    }

    /// Its name in the dataflow.
    pub(crate) fn name(&self) -> String {
        self.node.id().to_string()
    }

    /// Sends `array` on `output`, with the fields of `header` and those of every message as
    /// metadata. An output that the dataflow does not name is no error.
    ///
    /// # Errors
    /// The daemon cannot be reached.
    pub(crate) fn send(
        &mut self,
        output: &'static str,
        header: &impl Serialize,
        array: ArrayRef,
    ) -> Result<(), Failure> {
        let number = self.numbers.entry(output).or_default();
        let mut entries = metadata(header);
        entries.extend(metadata(&Stamp { boot: self.boot, number: *number, sent_ns: now_ns() }));
        *number += 1;
        Ok(self.node.send_output(DataId::from(output.to_owned()), entries, DoraArray::from(array))?)
    }

    /// Writes a warning to the log of the dataflow.
    pub(crate) fn warn(&self, text: &str) {
        self.node.log_warn(text);
    }
}

/// A message that has arrived.
#[derive(Debug)]
pub(crate) struct Message {
    /// The input.
    pub(crate) input: String,
    /// Its metadata.
    pub(crate) metadata: MetadataParameters,
    /// Its array.
    pub(crate) data: DoraArray,
    /// When it was taken from the queue, in nanoseconds since 1970.
    pub(crate) received_ns: i64,
}

/// The side of a node that receives.
pub(crate) struct Inputs {
    events: EventStream,
    has_ended: bool,
    /// Life of the sender and numbers of its messages, for each input of [`Self::missing`].
    numbers: HashMap<String, (i64, Numbers)>,
}

impl Inputs {
    /// The messages that are there, in order of arrival on each input; waits at most `most` for the
    /// first. Empty if none has come.
    pub(crate) fn take(&mut self, most: Duration) -> Vec<Message> {
        let mut messages = Vec::new();
        if !most.is_zero() {
            match self.events.recv_timeout(most) {
                Some(event) => self.note(event, &mut messages),
                None => self.has_ended = true,
            }
        }
        // After the end too: what had arrived before it comes after it.
        match self.events.drain() {
            Some(events) => events.into_iter().for_each(|event| self.note(event, &mut messages)),
            None => self.has_ended = true,
        }
        messages
    }

    fn note(&mut self, event: Event, messages: &mut Vec<Message>) {
        match event {
            Event::Input { id, metadata, data } => messages.push(Message {
                input: id.to_string(),
                metadata: metadata.parameters,
                data,
                received_ns: now_ns(),
            }),
            Event::Stop(_) => self.has_ended = true,
            // A wait that ended without a message is an error event too.
            _ => (),
        }
    }

    /// Whether the dataflow asks the node to end, or nobody is left who sends.
    pub(crate) fn have_ended(&self) -> bool {
        self.has_ended
    }

    /// Messages that the queues of the inputs dropped since the last call.
    pub(crate) fn dropped(&mut self) -> impl Iterator<Item = (String, u64)> + use<> {
        self.events.drain_drop_counts().into_iter().map(|(input, count)| (input.to_string(), count))
    }

    /// How many messages are missing before `message` on its input, and why; also notes what the
    /// queues dropped.
    ///
    /// # Errors
    /// The message has no number.
    pub(crate) fn missing(&mut self, message: &Message) -> Result<Option<(u64, Reason)>, MessageError> {
        for (input, count) in self.dropped() {
            self.numbers.entry(input).or_default().1.dropped(count);
        }
        let Stamp { boot, number, .. } = read(&message.metadata)?;
        let (life, numbers) = self.numbers.entry(message.input.clone()).or_default();
        if boot > *life {
            (*life, *numbers) = (boot, Numbers::default());
        }
        Ok(if boot < *life { None } else { numbers.arrived(number) }.filter(|&(missing, _)| missing > 0))
    }
}
