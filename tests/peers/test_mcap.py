"""MCAP, compared with the Python packages mcap and mcap-ros2-support: they read a log, and write a bag."""
import base64
import json
import struct

import pytest
from conftest import ROOT, SENSOR, as_csv, events, predicted, program

pytest.importorskip("mcap")
pytest.importorskip("mcap_ros2")
from mcap.reader import make_reader  # noqa: E402
from mcap_ros2.decoder import DecoderFactory  # noqa: E402
from mcap_ros2.writer import Writer  # noqa: E402

STAMPED = """
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
""" + STAMPED
IMAGE = """std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
""" + STAMPED


def messages(path):
    """Each topic's messages: type, time in microseconds and content. Every checksum is checked."""
    topics = {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        expected = reader.get_summary().statistics.message_count
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            decoder = DecoderFactory().decoder_for(channel.message_encoding, schema)
            content = decoder(message.data) if decoder else json.loads(message.data)
            topics.setdefault(channel.topic, []).append((schema.name, message.log_time // 1000, content))
    assert sum(map(len, topics.values())) == expected
    return topics


def rows_of(packets):
    rows = []
    for name, _, packet in packets:
        assert (name, packet.encoding) == ("event_camera_msgs/msg/EventPacket", "mono")
        assert (packet.width, packet.height) == SENSOR
        for (bits,) in struct.iter_unpack("<Q", bytes(packet.events)):
            t_us = (packet.time_base + (bits & 0xFFFFFFFF)) // 1000
            rows.append([t_us, bits >> 32 & 0xFFFF, bits >> 48 & 0x7FFF, bits >> 63])
    return rows


def test_the_events_of_a_recording_that_is_converted_are_the_same(recording, tmp_path):
    rows, path = recording
    bag = tmp_path / "finger.mcap"
    assert program("convert", path, bag).returncode == 0
    assert rows_of(messages(bag)["/events"]) == rows.tolist()


def test_a_log_has_the_predictions_that_are_printed_and_the_truth(tmp_path):
    log = tmp_path / "press.mcap"
    ran = program("run", "--json", "--mcap", log)
    predictions, _ = predicted(ran.stdout)
    topics = messages(log)
    found = [[content["roll_rad"], content["pitch_rad"]] for _, _, content in topics["/prediction"]]
    assert found == [value for _, value in predictions]
    assert all(content["update_us"] > 0 for _, _, content in topics["/latency"])
    assert topics["/truth"][0][2].keys() == {"depth_mm", "roll_rad", "pitch_rad"}
    assert len(topics["/events/image"]) >= 8
    for name, _, content in topics["/events/image"]:
        assert name == "foxglove.CompressedImage" and content["format"] == "png"
        assert base64.b64decode(content["data"]).startswith(b"\x89PNG")
    exact = program("convert", ROOT / "run/assets/dome_press.evt3", tmp_path / "press.csv")
    assert exact.returncode == 0
    written = [list(map(int, line.split(","))) for line in (tmp_path / "press.csv").read_text().splitlines()[2:]]
    taken = rows_of(topics["/events"])
    assert taken == written[::len(written) // len(taken)][:len(taken)]


def test_a_bag_of_the_python_packages_is_read(tmp_path):
    rows = events(5_000)
    header = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "camera"}
    bag = tmp_path / "bag.mcap"
    with open(bag, "wb") as file:
        # Chunks in Zstandard are the default.
        writer = Writer(file)
        packet = writer.register_msgdef("event_camera_msgs/msg/EventPacket", PACKET)
        image = writer.register_msgdef("sensor_msgs/msg/Image", IMAGE)
        for seq, part in enumerate(rows.reshape(10, 500, 4).tolist()):
            base = part[0][0] * 1000
            content = b"".join(struct.pack("<Q", p << 63 | y << 48 | x << 32 | t * 1000 - base) for t, x, y, p in part)
            writer.write_message("/camera/events", packet, {
                "header": header, "height": SENSOR[1], "width": SENSOR[0], "seq": seq, "time_base": base,
                "encoding": "mono", "is_bigendian": False, "events": content}, log_time=base)
        for number in range(3):
            writer.write_message("/camera/image", image, {
                "header": header, "height": 240, "width": 320, "encoding": "mono8", "is_bigendian": 0, "step": 320,
                "data": bytes([number]) * (240 * 320)}, log_time=number)
        writer.finish()
    told = json.loads(program("info", "--json", bag).stdout)
    assert (told["events"], told["sensor"]) == (5_000, list(SENSOR))
    assert [(other["name"], other["elements"]) for other in told["other_streams"]] == [("/camera/image", 3)]
    assert program("convert", bag, tmp_path / "back.csv").returncode == 0
    assert (tmp_path / "back.csv").read_text() == as_csv(tmp_path / "there.csv", rows).read_text()
    canf = program("run", bag, "--network", "canf", "--json")
    assert canf.returncode == 0, canf.stderr.decode()
    names = [json.loads(line).get("image", "") for line in canf.stdout.decode().splitlines()]
    assert [name[-10:] for name in names if name] == ["000001.png", "000002.png", "000003.png"]
