"""Presses with labels, the training data of `fit`: every epoch reads them at other ages, mirrored, shifted and thinned."""

from __future__ import annotations

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open

from .. import InputError, datasets
from ._graphs import columns_of, moved

# Labels that change their sign in a mirror: pitch in one along columns, roll in one along rows.
MIRRORED = {"columns": ("pitch", "tilt_x"), "rows": ("roll", "tilt_y")}
ANGLES = {("deg", "rad"): np.pi / 180, ("rad", "deg"): 180 / np.pi}
# Number of presses whose graphs are built together.
CHUNK = 320


class Film:
    """All presses of a file of `meissner simulate` or `meissner prepare presses`, in memory: events, and labels along time."""

    def __init__(self, path):
        self.path, dataset = Path(path), datasets.presses(path)
        samples = [dataset[i] for i in range(len(dataset))]
        self.sensor, self.classes = dataset.sensor, None
        self.events = [columns_of(sample.events).astype(np.int32) for sample in samples]
        self.times = [sample.more["t_us"] for sample in samples]
        with safe_open(path, "np") as file:
            self.units = json.loads((file.metadata() or {}).get("units", "{}"))
        self.labels = {name: [sample.more[name] for sample in samples] for name in samples[0].more if name != "t_us"}
        # If there is a depth, contact is the time when it begins to rise.
        depths = self.labels.get("depth", [np.ones(2)] * len(self))
        rises = [t[max(np.argmax(depth > 0) - 1, 0)] for t, depth in zip(self.times, depths)]
        self.contact_us, self.end_us = np.array(rises), np.array([t[-1] for t in self.times])

    @classmethod
    def of_classes(cls, sensor, events, classes):
        """Recordings, each with the index of a class."""
        film = cls.__new__(cls)
        film.path, film.sensor, film.classes = None, tuple(sensor), np.asarray(classes)
        film.events = [columns_of(each).astype(np.int32) for each in events]
        film.end_us = [each[-1:, 0].max(initial=0) for each in film.events]
        return film

    def __len__(self):
        return len(self.events)

    def at(self, names, press, t_us, units=()):
        """Labels (times, names) of a press at some times, angles in `units`, with linear interpolation between known labels."""
        missing = [name for name in names if name not in self.labels]
        if missing:
            raise InputError(f"{self.path}: expected labels {', '.join(names)}, found {', '.join(self.labels)}")
        found = np.stack([np.interp(t_us, self.times[press], self.labels[name][press]) for name in names], 1)
        for column, name, wanted in zip(found.T, names, units):
            has = self.units.get(name, wanted)
            if has != wanted and (has, wanted) not in ANGLES:
                raise InputError(f"{self.path}: expected label {name} in {wanted}, found {has}")
            column *= ANGLES.get((has, wanted), 1.0)
        return found


class Presses:
    """The same presses in one or more films, by different cameras. An epoch shows each press once, from a random camera.

    `films` are paths, or `Film`s. Images are mirrored along the axes of `mirrors` ("columns", "rows"; a dict names the outputs that change
    their sign) with a probability of a half, and shifted by up to `shift` pixels. A stream is thinned by a random stride in `strides`.
    A press is read at `times` random ages, none before the share `youngest` of it, and at its end; or at only one of them if later events
    change earlier rows (see `Module.reads_any_time`). A graph is used `passes` times; an epoch has at most `limit` presses.
    `augment(events, random)` returns a changed stream; `told(film, press, t_us)` returns values (times, any) to append to the targets."""

    def __init__(
        self, *films, mirrors=(), shift=2, strides=(1, 1), times=1, youngest=0.1, batch=16, passes=1, limit=None, augment=None, told=None
    ):
        self.films = [film if isinstance(film, Film) else Film(film) for film in films]
        self.sensor = self.films[0].sensor
        if len({(film.sensor, len(film)) for film in self.films}) != 1:
            found = ", ".join(f"{len(film)} on {film.sensor}" for film in self.films)
            raise InputError(f"films: expected the same presses on one sensor, found {found}")
        self.mirrors = mirrors if isinstance(mirrors, dict) else {axis: MIRRORED[axis] for axis in mirrors}
        self.shift, self.strides, self.times, self.youngest, self.batch = shift, strides, times, youngest, batch
        self.passes, self.limit, self.augment, self.told = passes, limit, augment, told

    def __len__(self):
        return len(self.films[0])

    def epoch(self, module, random):
        """Batches of an epoch: its done share, the module's input, and the targets. The next graphs are built in the background."""
        order = random.permutation(len(self))[: self.limit]
        chunks, seen = [order[first : first + CHUNK] for first in range(0, len(order), CHUNK)], 0
        with ThreadPoolExecutor(1) as builder:

            def build(chunk):
                plan = self._planned(module, chunk, random)
                return plan, builder.submit(module.graphs, self.sensor, [stream for *_, stream in plan])

            coming = build(chunks[0])
            for number, chunk in enumerate(chunks):
                plan, graphs = coming[0], coming[1].result()
                if number + 1 < len(chunks):
                    coming = build(chunks[number + 1])
                for _ in range(self.passes):
                    for first in self.batch * random.permutation(-(-len(chunk) // self.batch)):
                        part = range(first, min(first + self.batch, len(chunk)))
                        yield seen / len(order) / self.passes, *self._batch(module, graphs, part, plan, random)
                        seen += len(part)

    def _planned(self, module, chosen, random):
        """For each press its film, number, times, mirrors and shift, and events."""
        plan = []
        for film, press in zip(random.integers(len(self.films), size=len(chosen)), chosen):
            film, move = self.films[film], ([], (0, 0))
            stream, times = film.events[press], np.array([film.end_us[press]])
            if self.augment:
                stream = self.augment(stream, random)
            stride = random.integers(self.strides[0], self.strides[1] + 1)
            stream = stream[random.integers(stride) :: stride]
            if film.classes is None:
                times = self._ages(film, press, random)
                if not module.reads_any_time:
                    # Such a graph is read only at its end, so half of the presses are cut off.
                    times = times[random.integers(2) :][:1]
                    stream = stream[stream[:, 0] <= times[0]]
            if module.levels > 1:
                # The cells of a pooling are fixed, so events are mirrored and shifted before their graphs are built.
                move = self._move(random)
                stream = moved(stream, self.sensor, *move)
            plan.append((film, press, times, move, stream))
        return plan

    def _ages(self, film, press, random):
        contact, end = film.contact_us[press], film.end_us[press]
        return np.array([*random.uniform(contact + self.youngest * (end - contact), end, self.times), end]).astype(np.int64)

    def _move(self, random):
        mirrors = [axis for axis in self.mirrors if random.random() < 0.5]
        return mirrors, random.integers(-self.shift, self.shift + 1, 2)

    def _batch(self, module, graphs, part, plan, random):
        films, presses, times, moves, _ = zip(*(plan[i] for i in part))
        move = self._move(random) if module.reads_any_time and films[0].classes is None else None
        if films[0].classes is not None:
            return graphs.batch(part), torch.tensor([film.classes[press] for film, press in zip(films, presses)])
        targets = []
        for film, press, at, own in zip(films, presses, times, moves):
            label = film.at(module.said["outputs"], press, at, module.said["units"]) * self.turned(module, (move or own)[0])
            targets.append(label if self.told is None else np.concatenate([label, self.told(film, press, at)], 1))
        # If graphs are read at their ends, the times are those of the last events.
        read = (np.stack(times), *move) if move else ()
        return graphs.batch(part, *read), torch.from_numpy(np.concatenate(targets).astype(np.float32))

    def turned(self, module, mirrors):
        """The signs (outputs,) of the labels in some mirrors."""
        names = [name for axis in mirrors for name in self.mirrors[axis]]
        return np.array([-1 if name in names else 1 for name in module.said["outputs"]])


@torch.no_grad()
def errors(module, presses, shares=(1.0,)):
    """Outputs minus labels (presses, shares, outputs) of the first film of `Presses` at shares of each press, on every `strides[0]`-th
    event. For classes 1 if the largest output is of another one, (presses, 1, 1). If a graph is read only at its end, only at the last
    share; `Readouts` at the end."""
    module.eval()
    device, found = module.unit.device, []
    if isinstance(presses, Readouts):
        for given, target in presses.at_ends():
            values = module({name: value.to(device) for name, value in given.items()}).cpu()
            found.append((values - target[:, : values.shape[1]]).numpy()[:, None])
        return np.concatenate(found)
    film, stride = presses.films[0], presses.strides[0]
    shares = np.array(shares if module.reads_any_time else shares[-1:])
    for first in range(0, len(film), CHUNK):
        chosen = range(first, min(first + CHUNK, len(film)))
        streams = [film.events[i][::stride] for i in chosen]
        if film.classes is None:
            contact, end = (each[first : chosen.stop, None] for each in (film.contact_us, film.end_us))
            times = (contact + shares * (end - contact)).astype(np.int64)
            if not module.reads_any_time:
                streams = [stream[stream[:, 0] <= at[-1]] for stream, at in zip(streams, times)]
        graphs = module.graphs(film.sensor, streams)
        for begin in range(0, len(chosen), presses.batch):
            part = range(begin, min(begin + presses.batch, len(chosen)))
            at_times = film.classes is None and module.reads_any_time
            values = module(graphs.batch(part, times[part.start : part.stop] if at_times else None).to(device)).cpu().numpy()
            if film.classes is not None:
                found.append((values.argmax(1) != film.classes[first:][part.start : part.stop])[:, None, None].astype(np.float64))
                continue
            truth = [film.at(module.said["outputs"], chosen[i], times[i], module.said["units"]) for i in part]
            found.append(values.reshape(len(part), len(shares), -1) - np.stack(truth))
    return np.concatenate(found)


class Readouts:
    """Inputs of the layers after the readout, from films of the same presses. The event layers of `module` compute them once, so that an
    epoch takes seconds. Each press is read at its end and at `ages` - 1 random ages, unchanged and in all combinations of mirrors.

    A batch is {readout: values} of one film, a share `ends` of it at the ends of presses. The values are kept in `folder`, in half
    precision, as long as the event layers do not change. The other arguments are those of `Presses`."""

    def __init__(self, module, *films, folder, ages=5, ends=0.5, mirrors=(), batch=32, told=None, youngest=0.2):
        self.readout = next(name for name, layer in module.layers.items() if layer["kind"] == "readout")
        self.ages, self.ends, self.batch, self.youngest, self.told = ages, ends, batch, youngest, told
        turns = Presses.__new__(Presses)
        turns.mirrors = mirrors if isinstance(mirrors, dict) else {axis: MIRRORED[axis] for axis in mirrors}
        images = [[]]
        for axis in turns.mirrors:
            images += [[*image, axis] for image in images]
        blocks = module.names(*module.up_to(self.readout))
        made = hashlib.sha256(b"".join(module[name].detach().cpu().numpy().tobytes() for name in blocks)).hexdigest()
        made = json.dumps([made, module.said["preparation"], ages, youngest, images, bool(told)])
        self.values, self.targets = [], []
        for path in map(Path, films):
            kept = Path(folder) / hashlib.sha256(f"{path.resolve()} {made}".encode()).hexdigest()[:24]
            if not kept.with_suffix(".targets.npy").exists():
                kept.parent.mkdir(parents=True, exist_ok=True)
                self._write(module, Film(path), turns, images, kept)
            self.values.append(np.load(kept.with_suffix(".npy"), "r"))
            self.targets.append(np.load(kept.with_suffix(".targets.npy")))
            self.sensor = tuple(np.load(kept.with_suffix(".sensor.npy")).tolist())

    @torch.no_grad()
    def _write(self, module, film, turns, images, kept):
        random, found, targets = np.random.default_rng(sum(str(film.path).encode())), None, []
        module.eval()
        for first in range(0, len(film), 40):
            chosen = range(first, min(first + 40, len(film)))
            contact, end = (each[first : chosen.stop, None] for each in (film.contact_us, film.end_us))
            # One random age in each of `ages` - 1 equal parts of a press's duration.
            part = np.arange(self.ages - 1) + random.random((len(chosen), self.ages - 1))
            part = np.concatenate([np.ones((len(chosen), 1)), self.youngest + (1 - self.youngest) * part / max(self.ages - 1, 1)], 1)
            times = (contact + part * (end - contact)).astype(np.int64)
            streams = [film.events[i] for i in chosen]
            if module.reads_any_time:
                graphs = module.graphs(film.sensor, streams)
                parts = [range(i, min(i + 8, len(chosen))) for i in range(0, len(chosen), 8)]
                read = [[graphs.batch(some, times[some.start : some.stop], image) for some in parts] for image in images]
                read = [torch.cat([module.values(each, self.readout).half() for each in image]) for image in read]
                values = torch.stack([each.unflatten(0, times.shape) for each in read], 1)
            else:
                cut = [[stream[stream[:, 0] <= end] for stream, end in zip(streams, age)] for age in times.T]
                read = [module.graphs(film.sensor, [moved(each, film.sensor, image) for each in age]) for image in images for age in cut]
                read = [module.values(graphs.batch(range(len(chosen))), self.readout).half() for graphs in read]
                values = torch.stack(read, 1).unflatten(1, (len(images), self.ages))
            if found is None:
                shape = (len(film), len(images) * self.ages, *values.shape[3:])
                found = np.lib.format.open_memmap(kept.with_suffix(".npy"), "w+", np.float16, shape)
            found[first : chosen.stop] = values.flatten(1, 2).numpy()
            for i, at in zip(chosen, times):
                label = film.at(module.said["outputs"], i, at, module.said["units"])
                own = [label * turns.turned(module, image) for image in images]
                told = [] if self.told is None else [np.tile(self.told(film, i, at), (len(images), 1))]
                targets.append(np.concatenate([np.concatenate(own), *told], 1).astype(np.float32))
        found.flush()
        np.save(kept.with_suffix(".sensor.npy"), film.sensor)
        np.save(kept.with_suffix(".targets.npy"), np.stack(targets))

    def __len__(self):
        return len(self.targets[0])

    def epoch(self, _, random):
        """Every press of every film, at its end or at another age."""
        films, images = len(self.values), self.targets[0].shape[1] // self.ages
        order = random.permutation(films * len(self))
        of_film = (order[order // len(self) == film] for film in range(films))
        # A step reads one film, so that its readings are one array.
        steps = [some for each in of_film for some in np.array_split(each, max(len(self) // self.batch, 1))]
        for done, step in enumerate(random.permutation(len(steps))):
            film, press = steps[step][0] // len(self), steps[step] % len(self)
            age = np.where(random.random(len(press)) < self.ends, 0, random.integers(min(1, self.ages - 1), self.ages, len(press)))
            yield done / len(steps), *self.read(film, press, age + self.ages * random.integers(images, size=len(press)))

    def at_ends(self):
        """The presses of the first film at their ends."""
        for first in range(0, len(self), 100):
            yield self.read(0, slice(first, first + 100), 0)

    def read(self, film, press, reading):
        """Values by the name of the readout, and targets, of some presses of a film."""
        values = torch.from_numpy(self.values[film][press, reading].astype(np.float32))
        return {self.readout: values}, torch.from_numpy(self.targets[film][press, reading])
