"""Windows as the engine sees them: `meissner prepare slip` makes them, this reads them.

Nothing is scaled, laid out or cut here, so that training and inference cannot differ.
"""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors import safe_open


@dataclass
class Prepared:
    """All windows of a data set, for one network."""

    frames: torch.Tensor  # (windows, steps, 1, 12, 11), (windows, steps, 24) or, scaled twice, (windows, steps, 48)
    label: torch.Tensor  # (windows,), an index into `classes`
    recording: torch.Tensor  # (windows,), an index into `recordings`
    object_set: list  # of each window: "Basic", "Solids", "Small" or "Textures"
    object: list  # of each window
    classes: list
    recordings: list  # names, such as "n/pen178"
    preparation: str  # what weights must say that they were trained on

    def of_set(self, name):
        """Indices of the windows of an object set."""
        return torch.tensor([i for i, found in enumerate(self.object_set) if found == name])


def prepare(meissner, data, network, folder):
    """The windows of `network` (a shipped name or a description's path) in the recordings under `data`."""
    path = Path(folder) / f"{Path(network).stem}.windows.safetensors"
    command = [meissner, "prepare", "slip", data, "--network", network, "--out", path]
    subprocess.run([str(word) for word in command], check=True)
    with safe_open(path, "pt") as file:
        said = {key: value for key, value in file.metadata().items()}
        objects, sets = json.loads(said["objects"]), json.loads(said["sets"])
        named = [objects[i] for i in file.get_tensor("object").tolist()]
        return Prepared(
            frames=file.get_tensor("frames"),
            label=file.get_tensor("label"),
            recording=file.get_tensor("recording"),
            object_set=[sets[name] for name in named],
            object=named,
            classes=json.loads(said["classes"]),
            recordings=json.loads(said["recordings"]),
            preparation=said["preparation"],
        )
