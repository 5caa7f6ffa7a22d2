"""The training loop: AdamW on the cross-entropy of the logits, one cycle of the rate, every epoch on other recordings."""

import time

import torch
import torch.nn.functional as F
from augment import augment
from graphs import Graphs
from network import NEIGHBOURS, READOUT_CELLS

BATCH = 32
RATE = 0.003
DECAY = 0.001
SMOOTHING = 0.05


def fit(network, recordings, seen, epochs, random, graphs):
    """Trains `network` in place on the recordings `seen`; `graphs` builds the graphs of streams. The last loss."""
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    steps = epochs * -(-len(seen) // BATCH)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=steps, pct_start=0.2)
    network.train()
    for epoch in range(epochs):
        started, total, right = time.time(), 0.0, 0
        order = random.permutation(seen)
        built = graphs([augment(recordings.events[i], recordings.side, random) for i in order])
        for first in range(0, len(order), BATCH):
            streams = range(first, min(first + BATCH, len(order)))
            label = torch.from_numpy(recordings.label[order[first : streams.stop]])
            logits = network(built.batch(streams, NEIGHBOURS, READOUT_CELLS))
            loss = F.cross_entropy(logits, label, label_smoothing=SMOOTHING)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += loss.item() * len(streams)
            right += (logits.argmax(1) == label).sum().item()
        loss, share = total / len(order), right / len(order)
        print(f"  epoch {epoch + 1:2}  loss {loss:.4f}  right {share:.4f}  {time.time() - started:.1f} s", flush=True)
    network.eval()
    return loss


@torch.no_grad()
def logits(network, built, streams):
    """Logits of the first `streams` streams."""
    parts = (range(first, min(first + BATCH, streams)) for first in range(0, streams, BATCH))
    return torch.cat([network(built.batch(part, NEIGHBOURS, READOUT_CELLS)) for part in parts])
