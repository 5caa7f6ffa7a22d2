"""Grasps as `meissner simulate grasp` writes them, as frames of event counts with the force at the end of each."""

import json
from dataclasses import dataclass

import numpy as np
from safetensors import safe_open

FRAMES = 41
PERIOD_US = 10_000


@dataclass
class Recordings:
    """All recordings of a file. Frame k has the events from k to below k + 1 periods, as the engine cuts them."""

    counts: np.ndarray  # (recordings, frames, 2, rows, columns), uint8: negative events, then positive ones
    force: np.ndarray  # (recordings, frames), N, at the end of each frame
    phase: np.ndarray  # (recordings, frames), 0 grasping, 1 holding, 2 releasing
    bolt: np.ndarray  # (recordings,), mm

    def __len__(self):
        return len(self.force)

    def part(self, chosen):
        """The recordings `chosen`."""
        return Recordings(self.counts[chosen], self.force[chosen], self.phase[chosen], self.bolt[chosen])


def read(path):
    """The recordings in the file at `path`."""
    with safe_open(path, "np") as file:
        width, height = json.loads(file.metadata()["sensor"])
        start, ends = file.get_tensor("start"), np.arange(1, FRAMES + 1) * PERIOD_US
        frame = file.get_tensor("t_us") // PERIOD_US
        channel = 2 * frame + file.get_tensor("on")
        value = (channel * height + file.get_tensor("y")) * width + file.get_tensor("x")
        truth = {name: file.get_tensor(f"truth.{name}") for name in ("t_us", "start", "force", "phase", "bolt")}
    size = FRAMES * 2 * height * width
    counts = np.empty((len(start) - 1, FRAMES, 2, height, width), np.uint8)
    for i in range(len(counts)):
        counts[i] = np.bincount(value[start[i] : start[i + 1]], minlength=size).reshape(counts[i].shape)
    labels = {name: [] for name in ("force", "phase", "bolt")}
    for first, last in zip(truth["start"], truth["start"][1:]):
        for name, values in labels.items():
            values.append(np.interp(ends, truth["t_us"][first:last], truth[name][first:last]))
    force, phase, bolt = (np.array(labels[name], np.float32) for name in ("force", "phase", "bolt"))
    return Recordings(counts, force, np.rint(phase).astype(int), bolt[:, 0])
