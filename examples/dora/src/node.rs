//! A node of a dataflow: numbered messages out, numbered messages in.

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use dora_node_api::arrow_v59::array::ArrayRef;
use dora_node_api::dora_core::config::DataId;
use dora_node_api::{DoraArray, DoraNode, Event, EventStream, MetadataParameters, NodeError};
use meissner_packets::{Numbers, PacketError, Reason, failed, now_ns};
use meissner_run::error::chain;
use serde::Serialize;

use crate::message::{Stamp, metadata, read};

/// The side of a node that sends.
pub(crate) struct Outputs {
    node: DoraNode,
    boot: i64,
    numbers: BTreeMap<&'static str, u64>,
}

/// The node for which the daemon has started this process.
///
/// # Errors
/// No daemon has started it, or the daemon cannot be reached.
pub(crate) fn start() -> Result<(Outputs, Inputs), PacketError> {
    let (node, events) = DoraNode::init_from_env().map_err(daemon)?;
    let outputs = Outputs { node, boot: now_ns(), numbers: BTreeMap::new() };
    Ok((outputs, Inputs { events, has_ended: false, numbers: HashMap::new() }))
}

/// The daemon refuses the node, or an output.
fn daemon(error: NodeError) -> PacketError {
    failed("the node's daemon")(chain(&error))
}

impl Outputs {
    /// Start of this node: the name of its life.
    pub(crate) fn boot(&self) -> i64 {
        self.boot
    }

    /// Its name in the dataflow.
    pub(crate) fn name(&self) -> String {
        self.node.id().to_string()
    }

    /// Sends `array` on `output`, with the fields of `header` and those of every message as
    /// metadata. An output that the dataflow does not name is not an error.
    ///
    /// # Errors
    /// The daemon cannot be reached.
    pub(crate) fn send(
        &mut self,
        output: &'static str,
        header: &impl Serialize,
        array: ArrayRef,
    ) -> Result<(), PacketError> {
        let number = self.numbers.entry(output).or_default();
        let mut entries = metadata(header);
        entries.extend(metadata(&Stamp { boot: self.boot, number: *number, sent_ns: now_ns() }));
        *number += 1;
        let sent = self.node.send_output(DataId::from(output.to_owned()), entries, DoraArray::from(array));
        sent.map_err(daemon)
    }

    /// Writes a warning to the log of the dataflow.
    pub(crate) fn warn(&self, text: &str) {
        self.node.log_warn(text);
    }

    /// Warns of a malformed message.
    pub(crate) fn warn_of(&self, message: &Message, error: &PacketError) {
        self.warn(&format!("{}: {}", message.input, chain(error)));
    }
}

/// A message that has arrived.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) input: String,
    pub(crate) metadata: MetadataParameters,
    pub(crate) data: DoraArray,
    /// Time when it was taken from the queue, in nanoseconds since 1970.
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
    /// The waiting messages, in order on each input; waits at most `most` for the first.
    pub(crate) fn take(&mut self, most: Duration) -> Vec<Message> {
        let mut messages = Vec::new();
        if !most.is_zero() {
            match self.events.recv_timeout(most) {
                Some(event) => self.note(event, &mut messages),
                None => self.has_ended = true,
            }
        }
        // Also after the end: messages that arrived before it come after it.
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

    /// Whether the dataflow asks the node to end, or no sender is left.
    pub(crate) fn have_ended(&self) -> bool {
        self.has_ended
    }

    /// Messages that the queues of the inputs dropped since the last call.
    pub(crate) fn dropped(&mut self) -> impl Iterator<Item = (String, u64)> + use<> {
        self.events.drain_drop_counts().into_iter().map(|(input, count)| (input.to_string(), count))
    }

    /// The number of missing messages before `message` on its input, and the reason.
    ///
    /// # Errors
    /// The message has no number.
    pub(crate) fn missing(&mut self, message: &Message) -> Result<Option<(u64, Reason)>, PacketError> {
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
