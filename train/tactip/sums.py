"""What the head of a network reads of presses, computed once with trained layers of events.

A press is read at its end and at random ages. What is read does not depend on the head, so that an epoch over it takes seconds. The labels
of a reading are the outputs of the network and the motion of all pins in principal modes, which only the training knows.
"""

import json
import tempfile
from dataclasses import dataclass

import numpy as np
import presses  # of train/angle
import torch
from graphs import Graphs
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

CHUNK, BATCH = 80, 8  # presses whose graphs are built together, and that are read together
YOUNGEST = 0.2  # of a press, the share of its duration
MODES = 40  # of the motion of the pins
UNIT = 10.0  # pixels, of a mode


@dataclass
class Read:
    """Readings of presses, each at its end first, then at its other ages from the youngest on."""

    sums: np.ndarray  # (press, age, channel, row, column), half precision, in a file
    labels: np.ndarray  # (press, age, output), in units of the data
    pins: np.ndarray  # (press, age, mode), the motion of the pins in units of UNIT
    sensor: list  # [width, height]

    def __len__(self):
        return len(self.labels)


class Modes:
    """The principal modes of the motion of all pins, over the ends of the presses and of the moves in some tracks."""

    def __init__(self, tracks):
        start, position = tracks["start"], tracks["position"].reshape(len(tracks["t_us"]), -1)
        self.rest = position[start[:-1]].mean(0)
        # The press ends at the knot in the middle, the move at the last one.
        knots = np.diff(start)
        ends = np.concatenate([position[start[1:] - 1], position[start[:-1] + knots // 2]]) - self.rest
        self.mean = ends.mean(0)
        moments = (ends - self.mean).T.astype(np.float64) @ (ends - self.mean)
        self.modes = np.linalg.eigh(moments)[1][:, ::-1][:, :MODES].astype(np.float32)

    def of(self, tracks, t_us):
        """The modes (press, age, mode) of `tracks` at times (press, age), in units of UNIT."""
        start, position = tracks["start"], tracks["position"].reshape(len(tracks["t_us"]), -1)
        found = np.zeros((*t_us.shape, MODES), np.float32)
        for press, at in enumerate(t_us):
            knots = slice(start[press], start[press + 1])
            modes = (position[knots] - self.rest - self.mean) @ self.modes / UNIT
            found[press] = np.stack([np.interp(at, tracks["t_us"][knots], mode) for mode in modes.T], 1)
        return found


def read(path, modes, network, settings):
    """The readings of the presses in the file at `path`. They are kept beside it, and the sums stay there."""
    kept, sums = path.with_suffix(".read.safetensors"), path.with_suffix(".sums.npy")
    if not kept.exists():
        data, tracks = presses.read(path), load_file(path.with_suffix(".tracks.safetensors"))
        # Equal paths have equal ages.
        random = np.random.default_rng(sum(str(path).encode()))
        t_us = drawn(data, settings.ages, random)
        labels = [[data.at(name, press, at) for name in settings.said["outputs"]] for press, at in enumerate(t_us)]
        labels = np.ascontiguousarray(np.float32(labels).transpose(0, 2, 1))
        summed(data, t_us, network, settings, sums)
        save_file({"labels": labels, "pins": modes.of(tracks, t_us)}, kept, {"sensor": json.dumps(data.sensor)})
    with safe_open(kept, "np") as file:
        return Read(np.load(sums, "r"), file.get_tensor("labels"), file.get_tensor("pins"), json.loads(file.metadata()["sensor"]))


def drawn(data, ages, random):
    """The end of each press, and as many other times as make `ages`, one in each of as many parts of its duration."""
    part = np.arange(ages - 1) + random.random((len(data), ages - 1))
    shares = np.concatenate([np.ones((len(data), 1)), YOUNGEST + (1 - YOUNGEST) * part / (ages - 1)], 1)
    return (data.contact_us[:, None] + shares * (data.end_us - data.contact_us)[:, None]).astype(np.int64)


@torch.no_grad()
def summed(data, t_us, network, settings, path):
    """Writes the sums of all presses at the times (press, age) to an array at `path`."""
    found = None
    network.eval()
    with tempfile.TemporaryDirectory() as folder:
        for first in range(0, len(data), CHUNK):
            chosen = range(first, min(first + CHUNK, len(data)))
            streams = [data.events[press] for press in chosen]
            graphs = Graphs(settings.meissner, settings.network, settings.said, data.sensor, streams, folder)
            for some in range(0, len(chosen), BATCH):
                part = range(some, min(some + BATCH, len(chosen)))
                at = slice(first + part.start, first + part.stop)
                sums = network.readout(graphs.part(part).read(t_us[at])).unflatten(0, t_us[at].shape)
                if found is None:
                    found = np.lib.format.open_memmap(path, "w+", np.float16, (*t_us.shape, *sums.shape[2:]))
                found[at] = sums.half().numpy()
    found.flush()
