"""The training loop: AdamW on the cross-entropy of the logits, every epoch on other recordings, and the mean of the weights
after each epoch of the second half.

The rate rises, falls and then stays: at a constant rate the weights of one epoch are a sample of where the loss is low, and
their mean lies in the middle (Izmailov et al. 2018, "Averaging weights leads to wider optima and better generalization",
Algorithm 1).
"""

import math
import time

import torch
import torch.nn.functional as F
from torch import nn
from augment import augment
from graphs import Graphs
from network import NEIGHBOURS, READOUT_CELLS

BATCH = 32
# Epochs in which the rate rises, the share of all at which it has fallen, and to what share of it.
RISE, FALLEN, LEAST = 4, 0.4, 0.33
DECAY = 0.001
SMOOTHING = 0.05


def fit(network, recordings, seen, settings, random, graphs):
    """Trains `network` in place on the recordings `seen`; `graphs` builds the graphs of streams, and
    `settings` has what the command line asks for. The last loss."""
    epochs, (share_cut, shortest_ms) = settings.epochs, settings.cut
    optimiser = torch.optim.AdamW(network.parameters(), settings.rate, weight_decay=DECAY)
    steps = -(-len(seen) // BATCH)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: share(step / steps, epochs))
    mean, averaged = None, 0
    network.train()
    for epoch in range(epochs):
        started, total, right = time.time(), 0.0, 0
        order = random.permutation(seen)
        built = graphs([augment(recordings.events[i], recordings.side, random, share_cut, 1_000 * shortest_ms) for i in order])
        for first in range(0, len(order), BATCH):
            streams = range(first, min(first + BATCH, len(order)))
            label = torch.from_numpy(recordings.label[order[first : streams.stop]])
            found = network(built.batch(streams, NEIGHBOURS, READOUT_CELLS))
            loss = F.cross_entropy(found, label, label_smoothing=SMOOTHING)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += loss.item() * len(streams)
            right += (found.argmax(1) == label).sum().item()
        if epoch >= epochs // 2:
            averaged += 1
            mean = including(mean, network, averaged)
        loss, correct = total / len(order), right / len(order)
        print(f"  epoch {epoch + 1:2}  loss {loss:.4f}  right {correct:.4f}  {time.time() - started:.1f} s", flush=True)
    with torch.no_grad():
        for parameter, value in zip(network.parameters(), mean):
            parameter.copy_(value)
    gather_statistics(network, built, len(order))
    return loss


def share(epoch, epochs):
    """The share of the rate at a time in epochs."""
    if epoch < RISE:
        return 0.1 + 0.9 * epoch / RISE
    fallen = min(1.0, (epoch - RISE) / max(FALLEN * epochs - RISE, 1))
    return LEAST + (1 - LEAST) * (1 + math.cos(math.pi * fallen)) / 2


def including(mean, network, count):
    """The mean of the weights, with the `count`th sample."""
    now = [parameter.detach().clone() for parameter in network.parameters()]
    return now if mean is None else [old + (new - old) / count for old, new in zip(mean, now)]


@torch.no_grad()
def gather_statistics(network, built, streams):
    """Running means and variances of batch norm over `streams` streams, without dropout; leaves `network` in evaluation."""
    network.eval()
    for norm in network.modules():
        if isinstance(norm, (nn.BatchNorm1d, nn.BatchNorm2d)):
            norm.reset_running_stats()
            norm.momentum = None  # the plain mean over batches
            norm.train()
    logits(network, built, streams)
    network.eval()


@torch.no_grad()
def logits(network, built, streams):
    """Logits of the first `streams` streams."""
    parts = (range(first, min(first + BATCH, streams)) for first in range(0, streams, BATCH))
    return torch.cat([network(built.batch(part, NEIGHBOURS, READOUT_CELLS)) for part in parts])
