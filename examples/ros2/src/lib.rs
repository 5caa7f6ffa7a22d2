//! A ROS 2 node that takes packets of an event camera and publishes predictions. It speaks the
//! protocol of ROS 2 (DDS) itself, so that neither building nor running it needs a ROS
//! installation.
//!
//! | module | contents |
//! |---|---|
//! | [`messages`] | the messages of ROS 2 that are read and written |
//! | [`inference`] | packets into predictions: `meissner_packets`, without any of ROS 2 |
//! | [`resync`] | words of EVT 3.0 after a packet that was lost |
//! | [`node`] | the node: topics, quality of service, networks |

pub mod error;
pub mod inference;
pub mod messages;
pub mod node;
pub mod resync;

pub use error::Error;
