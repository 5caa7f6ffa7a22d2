"""Recordings as the engine sees them: `meissner prepare digits` (or `touch`) reads them, this reads what it writes."""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from safetensors import safe_open


@dataclass
class Recordings:
    """All recordings of a data set."""

    events: list  # of each recording (events, 4): t in microseconds, x, y, on
    label: np.ndarray  # (recordings,)
    in_train: np.ndarray  # (recordings,), whether the data set's own split trains on it
    fold: np.ndarray  # (recordings,)
    names: list
    sensor: str  # JSON [width, height]
    side: int  # columns of the sensor; that of the digits is a square

    def __len__(self):
        return len(self.events)


def prepare(meissner, data, folds, folder, task=("digits",)):
    """The recordings of `task` under `data`."""
    path = Path(folder) / "recordings.safetensors"
    command = [meissner, "prepare", *task, data, "--folds", folds, "--out", path]
    subprocess.run([str(word) for word in command], check=True)
    with safe_open(path, "np") as file:
        columns = np.stack([file.get_tensor(name) for name in ("t_us", "x", "y", "on")], axis=1)
        said = file.metadata()
        return Recordings(
            events=np.split(columns, file.get_tensor("start")[1:-1]),
            label=file.get_tensor("label"),
            in_train=file.get_tensor("split") == 0,
            fold=file.get_tensor("fold"),
            names=json.loads(said["recordings"]),
            sensor=said["sensor"],
            side=json.loads(said["sensor"])[0],
        )
