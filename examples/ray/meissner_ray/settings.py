"""Settings of a run, and their identity: a run with another identity does not continue in the same folder.

The identity has the fingerprints of descriptions and weights, so a file that was rewritten under its old name is noticed.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import meissner

from .errors import SettingsError
from .recordings import PathLike

VERSIONS = {"meissner": version("meissner-events"), "meissner_ray": version("meissner-ray")}
"""Versions that results depend on."""


@dataclass(frozen=True)
class Settings:
    """The arguments of `meissner.evaluate` ("eval") or `meissner.pareto` ("pareto"), without the data.

    Descriptions and weights that are files have absolute paths, which mean the same to each worker.
    """

    command: str
    task: str
    networks: tuple[str, ...]
    weights: str | None = None
    trainings: str | None = None
    stride: int | None = None
    every_us: int | None = None
    only: tuple[str, ...] = ()
    timed: int | None = None
    repeats: int = 3
    sensor: tuple[int, int] | None = None
    from_us: int = 0

    @staticmethod
    def of(
        command: str,
        task: str,
        networks: str | PathLike | Iterable[PathLike],
        weights: PathLike | None,
        trainings: PathLike | None,
        **more: Any,
    ) -> Settings:
        """Settings with networks that exist. Raises `SettingsError`, and the exceptions of Meissner about files."""
        networks = [networks] if isinstance(networks, str | os.PathLike) else list(networks)
        if not networks:
            raise SettingsError("networks: expected names of networks or description files, found none")
        shipped = set(meissner.networks())
        names = tuple(_place(name, shipped) for name in networks)
        weights, trainings = (None if path is None else os.path.abspath(path) for path in (weights, trainings))
        if weights is not None and (trainings is not None or len(names) > 1):
            raise SettingsError("weights: expected one network and no trainings beside a file of weights")
        return Settings(command, task, names, weights, trainings, **more)

    def arguments(self) -> dict[str, Any]:
        """The arguments of the function that `command` names. The recording is judged by one thread."""
        common = {"networks": list(self.networks), "weights": self.weights, "trainings": self.trainings}
        if self.command == "eval":
            own = {"stride": self.stride, "every_us": self.every_us}
        else:
            own = {name: getattr(self, name) for name in ("only", "timed", "repeats", "sensor", "from_us")}
        return common | own | {"threads": 1, "progress": False}

    def check(self) -> None:
        """Raises the exceptions of Meissner about these settings, before thousands of recordings do."""
        # Settings are read before the data, which are missing here.
        nowhere = Path(os.devnull, "nothing")
        judge = meissner.evaluate if self.command == "eval" else meissner.pareto
        try:
            judge(self.task, nowhere, **self.arguments())
        except meissner.Error as error:
            if str(nowhere) not in str(error):
                raise

    def files(self) -> dict[str, tuple[int, int]]:
        """Size in bytes and time of the last change in nanoseconds of each file that a worker will read."""
        named = [*self.networks, *([self.weights] if self.weights else []), *_trainings(self.trainings)]
        stats = {name: Path(name).stat() for name in named if os.path.isabs(name)}
        return {name: (stat.st_size, stat.st_mtime_ns) for name, stat in stats.items()}

    def identity(self) -> dict[str, Any]:
        """Everything that results depend on, as values for JSON."""
        found = asdict(self) | {"networks": self.cards(), "weights": None, "trainings": None} | VERSIONS
        unused = ("only", "timed", "repeats", "sensor", "from_us") if self.command == "eval" else ("stride", "every_us")
        return {name: list(value) if isinstance(value, tuple) else value for name, value in found.items() if name not in unused}

    def cards(self) -> list[dict[str, Any]]:
        """Name, seed and fingerprint of each network with each of its weights.

        `weights` is the SHA-256 of the description and the weights; `file` is the file of a training, otherwise None.
        """
        cards = []
        for name in self.networks:
            description = meissner.Description(name if not os.path.isabs(name) else Path(name))
            files: list[str | None] = [*_trainings(self.trainings)] or [None]
            for file in files:
                weights = _weights(name, file or self.weights)
                if {"held_out", "held_out_windows"} & weights.metadata.keys():
                    # A fold names recordings of a whole data set.
                    raise SettingsError(f"{file or self.weights}: expected a whole training, found a fold of a cross-validation")
                text = description.to_toml().encode() + b"\0" + weights.to_bytes()
                seed = weights.metadata.get("seed", "")
                cards.append(
                    {
                        "network": description.name,
                        "seed": int(seed) if seed.lstrip("-").isdigit() else None,
                        "weights": hashlib.sha256(text).hexdigest(),
                        "file": file,
                    }
                )
        return cards


def _place(name: PathLike, shipped: set[str]) -> str:
    name = os.fspath(name)
    return name if name in shipped else os.path.abspath(name)


def _weights(network: str, file: str | None) -> meissner.Weights:
    return meissner.Weights(Path(file)) if file else meissner.Weights.shipped(network)


def _trainings(folder: str | None) -> list[str]:
    return [] if folder is None else [str(path) for path in sorted(Path(folder).glob("*.safetensors"))]
