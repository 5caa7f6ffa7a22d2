"""The training loop: AdamW on a robust loss of the values, every epoch on other events and at other ages of each press.

A press is read at random times since contact and at its end: the network is to be right as early as it can be.
"""

import math
import time

import numpy as np
import torch
import torch.nn.functional as F
from frames import Frames
from graphs import Graphs, has_pooled_blocks, reads_later_rows
from kept import KeptGraphs, KeptPresses
from presses import SHIFT, moved, random_mirrors, thinned, times, turned

DECAY = 0.001
RISE = 0.05
# Presses whose graphs are built together.
CHUNK = 320


def fit(network, data, settings, valid, random, resume, log=print):
    """Trains `network` in place on `data`, the presses as each camera saw them; `settings` has what the command line asks for.
    `resume` is a file with the state after an epoch, which is written after each."""
    kept = KeptPresses(data, settings, random) if settings.keep else None
    optimiser = torch.optim.AdamW(network.parameters(), settings.rate, weight_decay=DECAY)
    first, mean = 0, float("nan")
    if resume.exists():
        state = torch.load(resume, weights_only=False)
        network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        random.bit_generator.state, first, mean = state["random"], state["epochs"], state.get("loss", float("nan"))
    for epoch in range(first, settings.epochs):
        started, total, seen = time.time(), 0.0, 0
        network.train()
        presses = random.permutation(len(data[0]))[: settings.presses]
        for chunk in range(0, len(presses), CHUNK):
            part = presses[chunk : chunk + CHUNK]
            for batch, target in kept.batches(part, random) if kept else batches(data, part, settings, random):
                for group in optimiser.param_groups:
                    group["lr"] = settings.rate * share((epoch + seen / len(presses) / settings.passes) / settings.epochs)
                loss = F.smooth_l1_loss(network(batch), target.to(settings.device), beta=settings.beta)
                optimiser.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
                optimiser.step()
                total, seen = total + loss.item() * settings.batch, seen + settings.batch
        mean = total / seen
        line = f"epoch {epoch + 1:3}  loss {mean:.5f}  {time.time() - started:.1f} s"
        if (epoch + 1) % settings.check == 0 or epoch + 1 == settings.epochs:
            line += "  valid " + "  ".join(f"{name} {found}" for name, found in valid(network).items())
        log(line)
        state = {"network": network.state_dict(), "optimiser": optimiser.state_dict()}
        torch.save(state | {"random": random.bit_generator.state, "epochs": epoch + 1, "loss": mean}, resume)
    return mean


def share(done):
    """The share of the rate when a share of the training is done: it rises, then falls as a cosine to almost 0."""
    if done < RISE:
        return 0.1 + 0.9 * done / RISE
    return 0.01 + 0.99 * (1 + math.cos(math.pi * (done - RISE) / (1 - RISE))) / 2


def batches(data, presses, settings, random):
    """Batches of `presses`, each press as a random camera of `data` saw it, with their targets in units of the network."""
    sources = [data[i] for i in random.integers(len(data), size=len(presses))]
    stride = [int(random.integers(settings.strides[0], settings.strides[1] + 1)) for _ in presses]
    streams = [thinned(source.events[press], n, random) for source, press, n in zip(sources, presses, stride)]
    late = None
    if reads_later_rows(settings.said):
        # Such a graph is read at its end alone: half of the presses are cut off.
        late = [times(source, press, settings, random)[random.integers(2) :][:1] for source, press in zip(sources, presses)]
        streams = [stream[stream[:, 0] <= end] for stream, end in zip(streams, late)]
    moves = None
    if has_pooled_blocks(settings.said):
        # The cells of a pooling stay where they are: events are mirrored and shifted before their graphs are built.
        moves = [(random_mirrors(settings, random), random.integers(-SHIFT, SHIFT + 1, 2)) for _ in presses]
        streams = [moved(stream, sources[0].sensor, *move) for stream, move in zip(streams, moves)]
    graphs = prepared(settings, sources[0].sensor, streams)
    parts = [range(first, first + settings.batch) for first in range(0, len(streams) - settings.batch + 1, settings.batch)]
    for _ in range(settings.passes):
        for place in random.permutation(len(parts)):
            streams, part = parts[place], graphs.part(parts[place])
            mirrors = [] if moves else random_mirrors(settings, random)
            read, targets = [], []
            for i in streams:
                source, press = sources[i], presses[i]
                read.append(times(source, press, settings, random) if late is None else late[i])
                signs = turned(settings.outputs, moves[i][0] if moves else mirrors)
                targets.append(signs * np.stack([source.at(name, press, read[-1]) for name in settings.outputs], axis=1))
            target = torch.from_numpy(np.concatenate(targets).astype(np.float32) / settings.unit)
            shift = (0, 0) if moves else random.integers(-SHIFT, SHIFT + 1, 2)
            yield part.read(np.stack(read), mirrors, shift), target


def prepared(settings, sensor, streams):
    """What the network of `settings` reads of `streams`."""
    if settings.keep:
        return KeptGraphs(settings, sensor, streams, settings.device)
    if "graph" not in settings.said:
        return Frames(settings.said, sensor, streams)
    return Graphs(settings.meissner, settings.network, settings.said, sensor, streams, settings.folder)


@torch.no_grad()
def errors(network, presses, settings, stride, shares=(1.0,)):
    """Errors (presses, shares, outputs) at shares of each press, on every `stride`-th event."""
    network.eval()
    found = []
    if reads_later_rows(settings.said):
        shares = shares[-1:]
    for chunk in range(0, len(presses), CHUNK):
        chosen = range(chunk, min(chunk + CHUNK, len(presses)))
        streams = [presses.events[i][::stride] for i in chosen]
        if has_pooled_blocks(settings.said):
            streams = [stream[stream[:, 0] <= presses.end_us[i]] for i, stream in zip(chosen, streams)]
        graphs = prepared(settings, presses.sensor, streams)
        for first in range(0, len(streams), settings.batch):
            part = range(first, min(first + settings.batch, len(streams)))
            numbers = [chosen[i] for i in part]
            contact, end = presses.contact_us[numbers, None], presses.end_us[numbers, None]
            times = (contact + np.array(shares) * (end - contact)).astype(np.int64)
            truth = [np.stack([presses.at(name, i, t) for name in settings.outputs], 1) for i, t in zip(numbers, times)]
            batch = graphs.read(np.array(part), times[:, -1]) if settings.keep else graphs.part(part).read(times)
            values = network(batch).cpu().numpy().reshape(len(part), len(shares), -1)
            found.append(values * settings.unit - np.stack(truth))
    return np.concatenate(found)
