"""The training loop, the same for every network: Adam on the cross-entropy of the logits, at a constant rate, and the
mean of the weights after each epoch of the second half.

At a constant rate the weights of one epoch are a sample of where the loss is low: from one epoch to the next the accuracy
on objects that were not trained on jumps by ten points and more. Their mean lies in the middle (Izmailov et al. 2018,
"Averaging weights leads to wider optima and better generalization", Algorithm 1) and costs one pass for the statistics of
batch norm.
"""

import contextlib
import sys
import time
from pathlib import Path

import torch
import torch.nn.functional as F

sys.path.append(str(Path(__file__).resolve().parents[1]))
from shared import WeightMean, gather_statistics


def fit(network, recipe, frames, label, seed):
    """Trains `network` in place on `frames` (windows, steps, ...) and their `label`; the loss of each epoch."""
    shuffled = torch.Generator().manual_seed(seed)
    # The gradient of the penalty l2 * w^2 is 2 l2 w.
    optimiser = torch.optim.Adam(network.parameters(), recipe.rate, weight_decay=2 * recipe.l2)
    losses, mean = [], WeightMean()
    for epoch in range(recipe.epochs):
        network.train()
        started, total = time.time(), 0.0
        for batch in torch.randperm(len(label), generator=shuffled).split(recipe.batch):
            with fast():
                logits = network(frames[batch]).float()
            loss = cross_entropy(logits, label[batch], recipe.smoothing)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += loss.item() * len(batch)
        losses.append(total / len(label))
        if epoch >= recipe.epochs // 2:
            mean.add(network)
        print(f"  epoch {epoch + 1:2}  loss {losses[-1]:.4f}  {time.time() - started:.1f} s", flush=True)
    mean.copy_to(network)
    gather_statistics(network, lambda: run(network, frames))
    return losses


def run(network, frames):
    """Runs `network` over all `frames`, for what it gathers meanwhile."""
    for part in frames.split(256):
        with fast():
            network(part)


def cross_entropy(logits, label, smoothing):
    """Mean over the batch; of a committee's logits, (members, batch, 7), the sum over its members."""
    members = logits if logits.dim() == 3 else logits[None]
    return sum(F.cross_entropy(each, label, label_smoothing=smoothing) for each in members)


def fast():
    """Convolutions in bfloat16 with f32 sums, where the processor has tiles for them: half of the time. What is exported
    is f32, and so is every evaluation."""
    if torch.cpu._is_amx_tile_supported():
        return torch.autocast("cpu", torch.bfloat16)
    return contextlib.nullcontext()


@torch.no_grad()
def logits(network, frames):
    """Logits of all windows, in f32."""
    return torch.cat([network(part) for part in frames.split(256)])
