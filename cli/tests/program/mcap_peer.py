"""What the Python packages mcap and mcap-ros2-support read of a file, and a file that they write.

    mcap_peer.py read FILE          one JSON object: events, predictions, truth, topics, first bytes of pictures
    mcap_peer.py write FILE CSV     the events t,x,y,p of CSV as packets, and three grey pictures of 32 x 24 pixels
"""
import base64
import json
import pathlib
import struct
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

HEADER = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
PACKET = """std_msgs/Header header
uint32 height
uint32 width
uint64 seq
uint64 time_base
string encoding
bool is_bigendian
uint8[] events
""" + HEADER
IMAGE = """std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
""" + HEADER


def read(path):
    """Prints what there is."""
    found = {"events": [], "prediction": [], "truth": [], "latency": [], "pictures": [], "topics": {}}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        count = reader.get_summary().statistics.message_count
        messages = 0
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            messages += 1
            found["topics"][channel.topic] = schema.name
            if channel.topic == "/events":
                packet = DecoderFactory().decoder_for(channel.message_encoding, schema)(message.data)
                assert (packet.encoding, packet.is_bigendian) == ("mono", False)
                found["sensor"] = [packet.width, packet.height]
                for (bits,) in struct.iter_unpack("<Q", bytes(packet.events)):
                    t_us = (packet.time_base + (bits & 0xFFFFFFFF)) // 1000
                    found["events"].append([t_us, bits >> 32 & 0xFFFF, bits >> 48 & 0x7FFF, bits >> 63])
                continue
            content = json.loads(message.data)
            if channel.topic == "/events/image":
                found["pictures"].append(base64.b64decode(content["data"])[1:4].decode())
            else:
                found[channel.topic[1:]].append(dict(content, t_us=message.log_time // 1000))
    assert messages == count
    print(json.dumps(found))


def write(path, csv):
    """Writes events and pictures."""
    events = [tuple(map(int, line.split(","))) for line in pathlib.Path(csv).read_text().splitlines()
              if line[0].isdigit()]
    header = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "camera"}
    with open(path, "wb") as file:
        writer = Writer(file)
        packet = writer.register_msgdef("event_camera_msgs/msg/EventPacket", PACKET)
        image = writer.register_msgdef("sensor_msgs/msg/Image", IMAGE)
        for seq, first in enumerate(range(0, len(events), 500)):
            part = events[first:first + 500]
            base = min(event[0] for event in part) * 1000
            content = b"".join(struct.pack("<Q", p << 63 | y << 48 | x << 32 | t * 1000 - base) for t, x, y, p in part)
            writer.write_message("/camera/events", packet, {
                "header": header, "height": 260, "width": 346, "seq": seq, "time_base": base, "encoding": "mono",
                "is_bigendian": False, "events": content}, log_time=base)
        for number in range(3):
            writer.write_message("/camera/image", image, {
                "header": header, "height": 24, "width": 32, "encoding": "mono8", "is_bigendian": 0, "step": 32,
                "data": bytes((x * number) % 256 for x in range(24 * 32))}, log_time=number)
        writer.finish()


if __name__ == "__main__":
    {"read": read, "write": write}[sys.argv[1]](*sys.argv[2:])
