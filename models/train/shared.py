"""Code that the recipes share: their command lines, the program, recordings as it prepares them, and the metadata of weights."""

import argparse
import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from meissner import Description
from safetensors import safe_open


def arguments(about, networks, task, data, **more):
    """The command line of a recipe, with its own options and their defaults."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help=data)
    parser.add_argument("--network", nargs="+", choices=networks, default=list(networks), help="default: all")
    parser.add_argument("--out", type=Path, default=Path(f"models/weights/{task}"), help="default: %(default)s")
    parser.add_argument("--quick", type=int, help="presses of an epoch, of two epochs: whether it works, not how well")
    for name, default in {"seed": 0, **more}.items():
        is_flag, settings = default is False, {"type": type(default), "help": "default: %(default)s"}
        parser.add_argument(f"--{name}", default=default, **({"action": "store_true"} if is_flag else settings))
    torch.set_num_threads(1)
    return parser.parse_args()


def missing(args, network, seed, folds):
    """The missing weights of a network: the part that is held out, and their path."""
    for fold in folds or [None]:
        path = args.out / f"{network}.{seed}{'' if fold is None else f'.{fold}'}.safetensors"
        if not path.exists():
            print(path.stem, flush=True)
            yield fold, path


def meissner(*words, program="target/release/meissner"):
    """Runs the program."""
    subprocess.run([str(word) for word in (program, *words)], check=True)


def prepared(*words):
    """The tensors and the metadata of the output of `meissner prepare`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "prepared.safetensors"
        meissner("prepare", *words, "--out", path)
        with safe_open(path, "np") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata()


def some(chosen, quick):
    """All chosen items, or about `quick` of them."""
    return chosen[:: max(len(chosen) // quick, 1)] if quick else chosen


@dataclass
class Recordings:
    """All recordings of a labelled data set of events."""

    events: list  # of each recording (events, 4): t in microseconds, x, y, on
    label: np.ndarray  # (recordings,)
    in_train: np.ndarray  # (recordings,), whether the data set's own split trains on it
    fold: np.ndarray  # (recordings,)
    names: list
    sensor: list  # [width, height]

    @classmethod
    def read(cls, data, folds, *task):
        found, said = prepared(*task, data, "--folds", folds)
        columns = np.stack([found[name] for name in ("t_us", "x", "y", "on")], axis=1)
        events = np.split(columns, found["start"][1:-1])
        return cls(events, found["label"], found["split"] == 0, found["fold"], json.loads(said["recordings"]), json.loads(said["sensor"]))

    def seen(self, fold):
        """The recordings that a training sees: those of the split, or all but a fold."""
        return np.flatnonzero(self.in_train if fold is None else self.fold != fold)

    def remarks(self, fold, folds, seed, network, of):
        """The metadata of weights about the recordings of their training. The lifetime of edges is left out: no event leaves a window
        during a recording, so that both lifetimes give the same graph."""
        preparation = json.loads(Description(network).summary()["preparation"])
        preparation.pop("lifetime", None)
        said = {"recordings": len(self.seen(fold)), "sensor": self.sensor, "preparation": preparation, "seed": seed}
        if fold is None:
            return said | {"trained_on": "train", "about": f"trained on the training {of}, seed {seed}"}
        held_out = [self.names[i] for i in np.flatnonzero(self.fold == fold)]
        return said | {"fold": fold, "held_out": held_out, "about": f"trained on all {of} but fold {fold} of {folds}, seed {seed}"}
