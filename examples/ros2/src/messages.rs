//! Messages of ROS 2, field by field as their definitions name them: their order is their layout.

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds of the second.
    pub nanosec: u32,
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// When.
    pub stamp: Time,
    /// Where: a frame of coordinates.
    pub frame_id: String,
}

/// `event_camera_msgs/msg/EventPacket`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EventPacket {
    /// When the packet was made, and by which camera.
    pub header: Header,
    /// Rows of the sensor.
    pub height: u32,
    /// Columns of the sensor.
    pub width: u32,
    /// Number of the packet: a gap is a loss.
    pub seq: u64,
    /// Nanoseconds to which the times of encoding `mono` are added.
    pub time_base: u64,
    /// `evt3` or `mono`.
    pub encoding: String,
    /// Whether the most significant byte of the events comes first.
    pub is_bigendian: bool,
    /// The events.
    #[serde(with = "serde_bytes")]
    pub events: Vec<u8>,
}

/// `geometry_msgs/msg/Vector3`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// First value.
    pub x: f64,
    /// Second value.
    pub y: f64,
    /// Third value.
    pub z: f64,
}

/// `geometry_msgs/msg/Vector3Stamped`: a prediction of at most three values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3Stamped {
    /// That of the newest packet that the prediction covers.
    pub header: Header,
    /// The values, and 0 for those that the network does not have. An f32 is exact in them.
    pub vector: Vector3,
}

impl Vector3Stamped {
    /// Values of a message.
    pub const MAX: usize = 3;

    /// The message of a prediction; values after the third are left out.
    pub fn new(header: Header, values: &[f32]) -> Self {
        let value = |index| values.get(index).copied().unwrap_or(0.0).into();
        Self { header, vector: Vector3 { x: value(0), y: value(1), z: value(2) } }
    }
}

/// `std_msgs/msg/MultiArrayDimension`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MultiArrayDimension {
    /// Its name.
    pub label: String,
    /// Its length.
    pub size: u32,
    /// Values from one row to the next of the dimension before it.
    pub stride: u32,
}

/// `std_msgs/msg/MultiArrayLayout`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MultiArrayLayout {
    /// The dimensions.
    pub dim: Vec<MultiArrayDimension>,
    /// Values before the first.
    pub data_offset: u32,
}

/// `std_msgs/msg/Float32MultiArray`: a prediction of any number of values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Float32MultiArray {
    /// One dimension.
    pub layout: MultiArrayLayout,
    /// The values.
    pub data: Vec<f32>,
}

impl Float32MultiArray {
    /// The message of a prediction.
    pub fn new(values: &[f32]) -> Self {
        let size = values.len() as u32;
        let dim = MultiArrayDimension { label: "outputs".to_owned(), size, stride: size };
        Self { layout: MultiArrayLayout { dim: vec![dim], data_offset: 0 }, data: values.to_vec() }
    }
}
