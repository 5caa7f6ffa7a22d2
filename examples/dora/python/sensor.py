"""A source in Python: a line of events that moves over the sensor."""

import time

import pyarrow as pa
from dora import Node

node = Node()
boot, first = time.time_ns(), 0
for number in range(100):
    rows = range(20)
    events = pa.StructArray.from_arrays(
        [
            pa.array([1000 * number] * 20, pa.int64()),
            pa.array([number] * 20, pa.uint16()),
            pa.array(rows, pa.uint16()),
            pa.array([True] * 20, pa.bool_()),
        ],
        ["t_us", "x", "y", "on"],
    )
    node.send_output(
        "events",
        events,
        {"boot": boot, "number": number, "first": first, "sent_ns": time.time_ns(), "width": 346, "height": 260},
    )
    first += 20
    time.sleep(0.01)
