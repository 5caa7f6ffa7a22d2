"""What the head of a network reads of presses, and what it is to say of them.

`Readings` are computed once with layers of events that are trained already: a press is read at its end and at random ages. What is
read does not depend on the head, so that an epoch takes seconds. `Films` are read again in every epoch, with layers of events that
learn too. The labels are the outputs of the network and, where it has a layer for them, the motion of all pins in principal modes, which
only the training knows.
"""

import hashlib
import json
import tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import presses
import torch
from graphs import Graphs, has_pooled_blocks
from kept import KeptGraphs
from presses import turned
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

CHUNK, BATCH = 80, 8  # presses whose graphs are built together, and that are read together
YOUNGEST = 0.2  # of a press, the share of its duration
MODES = 40  # of the motion of the pins
UNIT = 10.0  # pixels, of a mode


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

    def of(self, tracks, press, t_us):
        """The modes (time, mode) of a press of `tracks` at some times, in units of UNIT."""
        knots = slice(*tracks["start"][press : press + 2])
        motion = tracks["position"][knots].reshape(len(tracks["t_us"][knots]), -1) - self.rest - self.mean
        modes = motion @ self.modes / UNIT
        return np.stack([np.interp(t_us, tracks["t_us"][knots], mode) for mode in modes.T], 1).astype(np.float32)


class Film:
    """The presses in a file, with the motion of their pins if there are `modes`."""

    def __init__(self, path, modes, names):
        self.data, self.tracks = presses.read(path), load_file(path.with_suffix(".tracks.safetensors")) if modes else None
        self.modes, self.names, self.sensor = modes, names, self.data.sensor

    def __len__(self):
        return len(self.data)

    def told(self, press, t_us):
        """The outputs (time, output) of a press at some times, in units of the data, and the modes of its pins (time, mode)."""
        labels = np.stack([self.data.at(name, press, t_us) for name in self.names], 1)
        pins = self.modes.of(self.tracks, press, t_us) if self.modes else np.empty((len(t_us), 0), np.float32)
        return np.float32(labels), pins


class Films:
    """Films of the same presses, which a network reads with layers of events that learn too."""

    def __init__(self, paths, modes, network, settings):
        self.films = [Film(path, modes, settings.said["outputs"]) for path in paths]
        self.network, self.settings, self.sensor = network, settings, self.films[0].sensor

    def __len__(self):
        return len(self.films[0])

    def epoch(self, random):
        """Every press of a random film, at its end and at random ages: the share of the epoch that is done, sums, labels and pins."""
        order = random.permutation(len(self))
        chosen = [(self.films[film], press) for film, press in zip(random.integers(len(self.films), size=len(self)), order)]
        streams = [film.data.events[press] for film, press in chosen]
        for some, part in parts(self.settings, self.sensor, streams, self.settings.batch):
            t_us = np.stack([drawn(film.data, [press], self.settings.ages, random)[0] for film, press in chosen[some]])
            labels, pins = zip(*(film.told(press, at) for (film, press), at in zip(chosen[some], t_us)))
            yield some.start / len(self), self.network.readout(part.read(t_us)), np.concatenate(labels), np.concatenate(pins)

    @torch.no_grad()
    def ends(self):
        """The same of the ends of the presses of the first film, without the share."""
        film = self.films[0]
        t_us = film.data.end_us[:, None].astype(np.int64)
        for some, part in parts(self.settings, self.sensor, film.data.events, BATCH):
            labels, pins = zip(*(film.told(press, t_us[press]) for press in range(some.start, some.stop)))
            yield self.network.readout(part.read(t_us[some])), np.concatenate(labels), np.concatenate(pins)


class Readings:
    """Readings of films of the same presses, each press at its end first, then at its other ages from the youngest on; and after these the
    same of its mirror images. They are kept beside the films until the layers of events are others, and the sums stay there."""

    def __init__(self, paths, modes, network, settings, mirrors=()):
        made = f"{digest(network)}, {settings.ages} ages, mirrored along {list(mirrors)}, {MODES if modes else 0} modes of pins"
        for path in paths:
            if made_as(path) != made:
                self.write(path, modes, network, settings, mirrors, made)
        # (press, reading, channel, row, column), half precision; (press, reading, output) in units of the data; (press, reading, mode).
        self.sums = [np.load(path.with_suffix(".sums.npy"), "r") for path in paths]
        told = [load_file(path.with_suffix(".read.safetensors")) for path in paths]
        self.labels, self.pins = ([each[name] for each in told] for name in ("labels", "pins"))
        with safe_open(paths[0].with_suffix(".read.safetensors"), "np") as file:
            self.sensor = json.loads(file.metadata()["sensor"])
        self.settings = settings

    def __len__(self):
        return len(self.labels[0])

    @staticmethod
    @torch.no_grad()
    def write(path, modes, network, settings, mirrors, made):
        """Reads the presses in the file at `path`, and remarks how this was `made`."""
        film = Film(path, modes, settings.said["outputs"])
        # Equal paths have equal ages.
        random = np.random.default_rng(sum(str(path).encode()))
        t_us = drawn(film.data, range(len(film)), settings.ages, random)
        images = [[]]
        for axis in mirrors:
            images += [[*image, axis] for image in images]
        found = None
        network.eval()
        for some, sums in (pooled if has_pooled_blocks(settings.said) else summed)(network, settings, film, t_us, images):
            if found is None:
                found = np.lib.format.open_memmap(path.with_suffix(".sums.npy"), "w+", np.float16, (len(film), *sums.shape[1:]))
            found[some] = sums.half().numpy()
        found.flush()
        labels, pins = (np.stack(each) for each in zip(*(film.told(press, at) for press, at in enumerate(t_us))))
        labels = np.concatenate([np.float32(labels * turned(film.names, image)) for image in images], 1)
        remarks = {"sensor": json.dumps(film.sensor), "made": made}
        save_file({"labels": labels, "pins": np.tile(pins, (1, len(images), 1))}, path.with_suffix(".read.safetensors"), remarks)

    def epoch(self, random):
        """Every press of every film, at its end or at another age: the share of the epoch that is done, sums, labels and pins."""
        films, presses, ages = len(self.sums), len(self), self.settings.ages
        images = self.labels[0].shape[1] // ages
        order = random.permutation(films * presses)
        # A step reads one film, so that its readings are one array.
        of_film = (order[order // presses == film] for film in range(films))
        steps = [some for each in of_film for some in np.array_split(each, presses // self.settings.batch)]
        for done, step in enumerate(random.permutation(len(steps))):
            film, press = steps[step][0] // presses, steps[step] % presses
            age = np.where(random.random(len(press)) < self.settings.ends, 0, random.integers(1, ages, len(press)))
            yield done / len(steps), *self.read(film, press, age + ages * random.integers(images, size=len(press)))

    def ends(self):
        """The same of the ends of the presses of the first film, without the share."""
        for first in range(0, len(self), 100):
            yield self.read(0, slice(first, first + 100), 0)

    def read(self, film, press, reading):
        """Sums, labels and pins of some presses of a film."""
        sums = torch.from_numpy(self.sums[film][press, reading].astype(np.float32))
        return sums, self.labels[film][press, reading], self.pins[film][press, reading]


def summed(network, settings, film, t_us, images):
    """What a network reads of some presses, a slice, of a film at their times: image after image, (press, reading, ...)."""
    for some, part in parts(settings, film.sensor, film.data.events, BATCH):
        sums = [network.readout(part.read(t_us[some], image)).unflatten(0, t_us[some].shape) for image in images]
        yield some, torch.cat(sums, 1)


def pooled(network, settings, film, t_us, images):
    """As `summed`, for networks with blocks over cells: a graph is read at its end alone, so that each time has its own."""
    for first in range(0, len(film), BATCH):
        some = slice(first, min(first + BATCH, len(film)))
        found = []
        for ends in t_us[some].T:
            streams = [events[events[:, 0] <= end] for events, end in zip(film.data.events[some], ends)]
            graphs = KeptGraphs(settings, film.sensor, streams, "cpu")
            found.append([network.readout(graphs.read(np.arange(len(ends)), ends, [image] * len(ends))) for image in images])
        yield some, torch.cat([torch.stack(image, 1) for image in zip(*found)], 1)


def digest(network):
    """A digest of the layers of events."""
    tensors = network.exported()
    return hashlib.sha256(b"".join(tensors[name].numpy().tobytes() for name in network.names(network.events))).hexdigest()


def made_as(path):
    """How the kept readings of the film at `path` were made, if there are any."""
    kept = path.with_suffix(".read.safetensors")
    if not kept.exists():
        return None
    with safe_open(kept, "np") as file:
        return file.metadata().get("made")


def drawn(data, chosen, ages, random):
    """The ends of presses, and as many other times as make `ages`, one in each of as many parts of a press's duration."""
    contact_us, end_us = (each[chosen, None] for each in (data.contact_us, data.end_us))
    part = np.arange(ages - 1) + random.random((len(chosen), ages - 1))
    shares = np.concatenate([np.ones((len(chosen), 1)), YOUNGEST + (1 - YOUNGEST) * part / (ages - 1)], 1)
    return (contact_us + shares * (end_us - contact_us)).astype(np.int64)


def parts(settings, sensor, streams, size):
    """The graphs of `size` streams after the other: a slice of `streams`, and what a network reads of it. The next are built meanwhile."""
    chunks = [streams[first : first + CHUNK] for first in range(0, len(streams), CHUNK)]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(1) as builder:

        def build(streams):
            return Graphs(settings.meissner, settings.network, settings.said, sensor, streams, folder)

        coming = builder.submit(build, chunks[0])
        for number, chunk in enumerate(chunks):
            graphs = coming.result()
            if number + 1 < len(chunks):
                coming = builder.submit(build, chunks[number + 1])
            for first in range(0, len(chunk), size):
                part = range(first, min(first + size, len(chunk)))
                yield slice(CHUNK * number + part.start, CHUNK * number + part.stop), graphs.part(part)
