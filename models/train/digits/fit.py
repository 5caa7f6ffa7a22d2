"""The training loop: AdamW on the cross-entropy of the logits, every epoch on other recordings, and the mean of the weights
after each epoch of the second half.

The rate rises, falls and then stays: at a constant rate the weights of one epoch are a sample of where the loss is low, and
their mean lies in the middle (Izmailov et al. 2018, "Averaging weights leads to wider optima and better generalization",
Algorithm 1).
"""

import math
import sys
import time
from pathlib import Path

import torch
import torch.nn.functional as F
from augment import augment
from graphs import Graphs
from network import NEIGHBOURS, READOUT_CELLS

sys.path.append(str(Path(__file__).resolve().parents[1]))
from shared import WeightMean, gather_statistics

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
    mean = WeightMean()
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
            mean.add(network)
        loss, correct = total / len(order), right / len(order)
        print(f"  epoch {epoch + 1:2}  loss {loss:.4f}  right {correct:.4f}  {time.time() - started:.1f} s", flush=True)
    mean.copy_to(network)
    gather_statistics(network, lambda: logits(network, built, len(order)))
    return loss


def share(epoch, epochs):
    """The share of the rate at a time in epochs."""
    if epoch < RISE:
        return 0.1 + 0.9 * epoch / RISE
    fallen = min(1.0, (epoch - RISE) / max(FALLEN * epochs - RISE, 1))
    return LEAST + (1 - LEAST) * (1 + math.cos(math.pi * fallen)) / 2


@torch.no_grad()
def logits(network, built, streams):
    """Logits of the first `streams` streams."""
    parts = (range(first, min(first + BATCH, streams)) for first in range(0, streams, BATCH))
    return torch.cat([network(built.batch(part, NEIGHBOURS, READOUT_CELLS)) for part in parts])
