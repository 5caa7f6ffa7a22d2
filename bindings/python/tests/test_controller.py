"""The controller of the examples: over a recording, and against a fingertip that the test plays."""

import re
import socket
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import meissner

ROOT = Path(__file__).parents[3]
CONTROLLER = ROOT / "examples/controller/controller.py"
RECORDING = ROOT / "run/assets/dome_press.evt3"
HOLD, PRESS = 2, 1

pytestmark = pytest.mark.skipif(not CONTROLLER.exists(), reason="the examples are not here")


def start(*arguments):
    environment = {"PYTHONPATH": str(Path(meissner.__file__).parents[1]), "PATH": "/usr/bin:/bin"}
    # A longer period than in the example, because a test machine is busy.
    command = [sys.executable, CONTROLLER, *map(str, arguments), "--period", "5000", "--deadline", "4000"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)


def test_a_recording_is_played_and_each_cycle_is_in_the_histogram():
    text = start(RECORDING, "--cycles", 30).communicate(timeout=60)[0]
    assert "30 cycles, deadlines missed:" in text, text
    rows = re.findall(r"^ +(?:\d+|more) +(\d+) +(\d+)$", text, re.MULTILINE)
    assert [sum(int(row[i]) for row in rows) for i in (0, 1)] == [30, 30], text


def test_a_fingertip_gets_targets_by_the_law_of_its_holds_and_the_end_of_the_events_ends_the_loop():
    fingertip = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    fingertip.bind(("127.0.0.1", 0))
    fingertip.settimeout(30)
    free = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
    free.close()
    child = start(f"udp://127.0.0.1:{port}", "--fingertip", f"127.0.0.1:{fingertip.getsockname()[1]}")
    try:
        cycles = []

        def target(state=None):
            datagram, address = fingertip.recvfrom(64)
            cycle, *angles = struct.unpack("<Qdd", datagram)
            cycles.append(cycle)
            if state is not None:
                fingertip.sendto(struct.pack("<qdddII", 0, 1.0, 0.1, -0.2, state, 3), address)
            return angles

        target()
        events = meissner.open(RECORDING).read()[:4000]
        for part in np.array_split(events, 50):
            records = np.zeros(len(part), {"names": ["t", "x", "y", "p"], "formats": ["<i8", "<u2", "<u2", "i1"], "itemsize": 16})
            for name in "txyp":
                records[name] = part[name]
            fingertip.sendto(records.tobytes(), ("127.0.0.1", port))
        # Outside of a hold the target stays.
        assert {tuple(target(PRESS)) for _ in range(20)} == {(0.0, 0.0)}
        alone = meissner.Engine("tactigraph-past", (346, 260))
        alone.push(events)
        predicted = alone.predict().values.astype("f8")
        expected = [0.1 + 0.8 * predicted[0], -0.2 + 0.8 * predicted[1]]
        angles = None
        for _ in range(2000):
            angles = target(HOLD)
            if np.allclose(angles, expected, rtol=0, atol=1e-12):
                break
        assert np.allclose(angles, expected, rtol=0, atol=1e-12)
        assert cycles == sorted(cycles)
        fingertip.sendto(b"", ("127.0.0.1", port))
        text = child.communicate(timeout=60)[0]
        assert "4000 events, 0 dropped" in text, text
    finally:
        child.kill()
        child.wait()
