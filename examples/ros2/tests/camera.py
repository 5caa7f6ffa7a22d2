"""A camera and a controller in Eclipse Cyclone DDS, under the names that ROS 2 gives topics and types.

    camera.py PACKETS RELIABILITY PERIOD_MS KIND

PACKETS is a file of JSON: a list of packets with the fields of event_camera_msgs/msg/EventPacket, whose events are in base64. It is
published with RELIABILITY (`reliable` or `best_effort`), one packet every PERIOD_MS. Every prediction that arrives is printed as a line
of JSON: `{"seq": ..., "values": [...]}`, with the bits of each value as a float64. A packet's number is in the nanoseconds of its
stamp, so that it comes back with the prediction.
KIND is `vector` or `array`, the type of the predictions. Publishing starts after a line `go` on standard input. A packet with the field
`waits` is published after one more line there, which it requests with `{"waiting": SEQ}`. It ends when it is killed.
"""

import base64
import json
import struct
import sys
import threading
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64, int32, sequence, uint8, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class EventPacket(IdlStruct, typename="event_camera_msgs::msg::dds_::EventPacket_"):
    header: Header
    height: uint32
    width: uint32
    seq: uint64
    time_base: uint64
    encoding: str
    is_bigendian: bool
    events: sequence[uint8]


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Vector3Stamped(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3Stamped_"):
    header: Header
    vector: Vector3


@dataclass
class MultiArrayDimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):
    label: str
    size: uint32
    stride: uint32


@dataclass
class MultiArrayLayout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    dim: sequence[MultiArrayDimension]
    data_offset: uint32


@dataclass
class Float32MultiArray(IdlStruct, typename="std_msgs::msg::dds_::Float32MultiArray_"):
    layout: MultiArrayLayout
    data: sequence[float32]


def bits(values):
    return [struct.unpack("<Q", struct.pack("<d", value))[0] for value in values]


def main():
    path, reliability, period_ms, kind = sys.argv[1:]
    with open(path) as file:
        packets = json.load(file)
    reliable = Policy.Reliability.Reliable(duration(seconds=10))
    sent_as = reliable if reliability == "reliable" else Policy.Reliability.BestEffort
    keep = Policy.History.KeepLast(256)
    participant = DomainParticipant(0)
    qos = Qos(sent_as, keep, Policy.Durability.Volatile)
    writer = DataWriter(participant, Topic(participant, "rt/event_camera/events", EventPacket, qos=qos), qos=qos)
    qos = Qos(reliable, Policy.History.KeepAll, Policy.Durability.Volatile)
    of = Vector3Stamped if kind == "vector" else Float32MultiArray
    reader = DataReader(participant, Topic(participant, "rt/meissner/prediction", of, qos=qos), qos=qos)

    until = time.monotonic() + 60
    while not (writer.get_matched_subscriptions() and reader.get_matched_publications()):
        if time.monotonic() > until:
            sys.exit("nobody subscribes to packets and publishes predictions")
        time.sleep(0.02)
    print(json.dumps({"matched": True}), flush=True)

    def publish():
        sys.stdin.readline()
        for packet in packets:
            if packet.pop("waits", False):
                print(json.dumps({"waiting": packet["seq"]}), flush=True)
                sys.stdin.readline()
            events = base64.b64decode(packet.pop("events"))
            header = Header(Time(17, packet["seq"]), "camera")
            writer.write(EventPacket(header=header, events=events, **packet))
            time.sleep(float(period_ms) / 1000)

    threading.Thread(target=publish, daemon=True).start()
    while True:
        for prediction in reader.take(N=100):
            # A publisher that is gone for a while appears as a sample without values.
            if not isinstance(prediction, of):
                continue
            if kind == "vector":
                seq, v = prediction.header.stamp.nanosec, prediction.vector
                assert prediction.header.frame_id == "camera" and prediction.header.stamp.sec == 17
                print(json.dumps({"seq": seq, "values": bits([v.x, v.y, v.z])}), flush=True)
            else:
                [dim] = prediction.layout.dim
                assert (dim.label, dim.size, dim.stride) == ("outputs", len(prediction.data), len(prediction.data))
                print(json.dumps({"seq": None, "values": bits(prediction.data)}), flush=True)
        time.sleep(0.002)


main()
