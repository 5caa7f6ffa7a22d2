"""The training loop, the same for every network: Adam on the cross-entropy of the logits, at a constant rate, and the
mean of the weights after each epoch of the second half.

At a constant rate the weights of one epoch are a sample of where the loss is low: from one epoch to the next the accuracy
on objects that were not trained on jumps by ten points and more. Their mean lies in the middle (Izmailov et al. 2018,
"Averaging weights leads to wider optima and better generalization", Algorithm 1) and costs one pass for the statistics of
batch norm.
"""

import contextlib
import time

import torch
import torch.nn.functional as F
from torch import nn


def fit(network, recipe, frames, label, seed):
    """Trains `network` in place on `frames` (windows, steps, ...) and their `label`; the loss of each epoch."""
    shuffled = torch.Generator().manual_seed(seed)
    # The gradient of the penalty l2 * w^2 is 2 l2 w.
    optimiser = torch.optim.Adam(network.parameters(), recipe.rate, weight_decay=2 * recipe.l2)
    losses, mean, averaged = [], None, 0
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
            averaged += 1
            mean = including(mean, network, averaged)
        print(f"  epoch {epoch + 1:2}  loss {losses[-1]:.4f}  {time.time() - started:.1f} s", flush=True)
    with torch.no_grad():
        for parameter, value in zip(network.parameters(), mean):
            parameter.copy_(value)
    gather_statistics(network, frames)
    return losses


def cross_entropy(logits, label, smoothing):
    """Mean over the batch; of a committee's logits, (members, batch, 7), the sum over its members."""
    members = logits if logits.dim() == 3 else logits[None]
    return sum(F.cross_entropy(each, label, label_smoothing=smoothing) for each in members)


def including(mean, network, count):
    """The mean of the weights, with the `count`th sample."""
    now = [parameter.detach().clone() for parameter in network.parameters()]
    return now if mean is None else [old + (new - old) / count for old, new in zip(mean, now)]


@torch.no_grad()
def gather_statistics(network, frames):
    """Running means and variances of batch norm over all `frames`, without dropout; leaves `network` in evaluation."""
    network.eval()
    norms = [module for module in network.modules() if isinstance(module, nn.BatchNorm1d)]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # the plain mean over batches
        norm.train()
    if norms:
        for part in frames.split(256):
            with fast():
                network(part)
    network.eval()


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
