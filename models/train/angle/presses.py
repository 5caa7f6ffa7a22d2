"""Presses as events with labels, as `meissner simulate markers` writes them."""

import json
from dataclasses import dataclass

import numpy as np
from safetensors import safe_open

SHIFT = 2  # pixels along each axis
# Labels change their sign in a mirror: that along columns turns pitch, that along rows turns roll.
MIRRORED = {"columns": ("pitch", "tilt_x"), "rows": ("roll", "tilt_y")}


@dataclass
class Presses:
    """All presses of a file."""

    events: list  # of each press (events, 4), int32: t in microseconds, x, y, on
    times: list  # of each press (times,): when the labels are known; they are linear between
    labels: dict  # by name, of each press (times,)
    contact_us: np.ndarray  # (presses,), when the depth begins to rise
    end_us: np.ndarray  # (presses,)
    sensor: list  # [width, height]

    def __len__(self):
        return len(self.events)

    def at(self, name, press, t_us):
        """The label `name` of a press at a time."""
        return np.interp(t_us, self.times[press], self.labels[name][press])


def read(path):
    """The presses in the file at `path`."""
    with safe_open(path, "np") as file:
        names = [name for name in file.keys() if name.startswith("truth.")]
        tensors = {name: file.get_tensor(name) for name in ("start", *names)}
        columns = np.stack([file.get_tensor(name).astype(np.int32) for name in ("t_us", "x", "y", "on")], axis=1)
        sensor = json.loads(file.metadata()["sensor"])
    bounds = tensors.pop("truth.start")
    split = {name: np.split(tensors[name], bounds[1:-1]) for name in names if name in tensors}
    times = split.pop("truth.t_us")
    labels = {name.removeprefix("truth."): values for name, values in split.items()}
    rises = [t[max(np.argmax(depth > 0) - 1, 0)] for t, depth in zip(times, labels["depth"])]
    return Presses(
        events=np.split(columns, tensors["start"][1:-1]),
        times=times,
        labels=labels,
        contact_us=np.array(rises),
        end_us=np.array([t[-1] for t in times]),
        sensor=sensor,
    )


def thinned(events, stride, random):
    """One event of `stride`, evenly from a random one on."""
    return events[random.integers(stride) :: stride]


def moved(events, sensor, mirrors, shift):
    """The events mirrored along columns or rows, then shifted by pixels; those beside the sensor are left out."""
    (width, height), (t_us, x, y, on) = sensor, events.T
    x = (width - 1 - x if "columns" in mirrors else x) + shift[0]
    y = (height - 1 - y if "rows" in mirrors else y) + shift[1]
    there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return np.stack([t_us, x, y, on], axis=1)[there]


def random_mirrors(settings, random):
    """The axes of a random mirror."""
    return [axis for axis in settings.mirrors if random.random() < 0.5]


def turned(outputs, mirrors):
    """The signs (outputs,) that labels have in a mirror."""
    names = [name for axis in mirrors for name in MIRRORED[axis]]
    return np.array([-1 if name in names else 1 for name in outputs])


def times(source, press, settings, random):
    """Random times since contact, and the end."""
    contact, end = source.contact_us[press], source.end_us[press]
    youngest = contact + settings.youngest * (end - contact)
    return np.array([*random.uniform(youngest, end, settings.times), end]).astype(np.int64)
