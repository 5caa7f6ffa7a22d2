//! Messages of ROS 2, with the fields of their definitions: the order is the layout.

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Time {
    sec: i32,
    nanosec: u32,
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Header {
    stamp: Time,
    frame_id: String,
}

/// `event_camera_msgs/msg/EventPacket`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct EventPacket {
    pub(crate) header: Header,
    pub(crate) height: u32,
    pub(crate) width: u32,
    /// Number of the packet: a gap is a loss.
    pub(crate) seq: u64,
    /// Nanoseconds to which the times of encoding `mono` are added.
    pub(crate) time_base: u64,
    /// `evt3` or `mono`.
    pub(crate) encoding: String,
    /// Whether the most significant byte of the events comes first.
    pub(crate) is_bigendian: bool,
    #[serde(with = "serde_bytes")]
    pub(crate) events: Vec<u8>,
}

/// `geometry_msgs/msg/Vector3Stamped`, with its `Vector3`: a prediction of at most three values.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Vector3Stamped {
    /// Header of the newest packet that the prediction covers.
    header: Header,
    /// They contain an f32 exactly.
    vector: [f64; 3],
}

impl Vector3Stamped {
    /// Maximum number of values of a message.
    pub(crate) const MAX: usize = 3;

    /// The message of a prediction, with 0 for values that the network does not have.
    pub(crate) fn new(header: Header, values: &[f32]) -> Self {
        let value = |index| values.get(index).copied().unwrap_or(0.0).into();
        Self { header, vector: std::array::from_fn(value) }
    }
}

/// `std_msgs/msg/MultiArrayDimension`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct MultiArrayDimension {
    label: String,
    size: u32,
    stride: u32,
}

/// `std_msgs/msg/Float32MultiArray`, with its `MultiArrayLayout`: a prediction of any number of
/// values.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Float32MultiArray {
    dim: Vec<MultiArrayDimension>,
    data_offset: u32,
    data: Vec<f32>,
}

impl Float32MultiArray {
    /// The message of a prediction.
    pub(crate) fn new(values: &[f32]) -> Self {
        let size = values.len() as u32;
        let dim = MultiArrayDimension { label: "outputs".to_owned(), size, stride: size };
        Self { dim: vec![dim], data_offset: 0, data: values.to_vec() }
    }
}
