"""What the head of a network reads of presses, computed once with trained layers of events.

A press is read at its end and at random ages. What is read does not depend on the head, so that an epoch over it takes seconds. The labels
of a reading are the outputs of the network and the motion of all pins in principal modes, which only the training knows.
"""

import tempfile
from dataclasses import dataclass

import numpy as np
import presses  # of train/angle
import torch
from graphs import Graphs
from safetensors.numpy import load_file, save_file

CHUNK, BATCH = 80, 8  # presses whose graphs are built together, and that are read together
YOUNGEST = 0.2  # of a press, the share of its duration
MODES = 40  # of the motion of the pins
UNIT = 10.0  # pixels, of a mode


@dataclass
class Read:
    """Readings of presses, each at its end first, then at its other ages from the youngest on."""

    sums: np.ndarray  # (press, age, channel, row, column), half precision
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
    """The presses in the file at `path`. The sums are kept beside it."""
    data, kept = presses.read(path), path.with_suffix(".sums.safetensors")
    if not kept.exists():
        # Equal paths have equal ages.
        random = np.random.default_rng(sum(str(path).encode()))
        save_file(summed(data, drawn(data, settings.ages, random), network, settings), kept)
    tensors, tracks = load_file(kept), load_file(path.with_suffix(".tracks.safetensors"))
    t_us = tensors["t_us"]
    labels = [[data.at(name, press, at) for name in settings.said["outputs"]] for press, at in enumerate(t_us)]
    return Read(tensors["sums"], np.float32(labels).transpose(0, 2, 1), modes.of(tracks, t_us), data.sensor)


def drawn(data, ages, random):
    """The end of each press, and as many other times as make `ages`, one in each of as many parts of its duration."""
    part = np.arange(ages - 1) + random.random((len(data), ages - 1))
    shares = np.concatenate([np.ones((len(data), 1)), YOUNGEST + (1 - YOUNGEST) * part / (ages - 1)], 1)
    return (data.contact_us[:, None] + shares * (data.end_us - data.contact_us)[:, None]).astype(np.int64)


@torch.no_grad()
def summed(data, t_us, network, settings):
    """The sums of all presses at the times (press, age), with these."""
    found = []
    network.eval()
    with tempfile.TemporaryDirectory() as folder:
        for first in range(0, len(data), CHUNK):
            chosen = range(first, min(first + CHUNK, len(data)))
            streams = [data.events[press] for press in chosen]
            graphs = Graphs(settings.meissner, settings.network, settings.said, data.sensor, streams, folder)
            for some in range(0, len(chosen), BATCH):
                part = range(some, min(some + BATCH, len(chosen)))
                times = t_us[first + part.start : first + part.stop]
                sums = network.readout(graphs.part(part).read(times))
                found.append(sums.unflatten(0, times.shape).half().numpy())
    # A file has the bytes as they lie in memory.
    return {"sums": np.ascontiguousarray(np.concatenate(found)), "t_us": np.ascontiguousarray(t_us)}
