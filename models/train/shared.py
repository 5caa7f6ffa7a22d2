"""What the trainings share: means of weights over epochs, files for tests, and the comparison with the engine."""

import argparse
import json
from pathlib import Path

import torch
from torch import nn

# Largest difference of a logit, relative to the largest magnitude of its row (at least 1).
MAX_DIFFERENCE = 1e-4


class WeightMean:
    """The mean of the weights of a network after several epochs."""

    def __init__(self):
        self.values, self.count = None, 0

    def add(self, network):
        """Includes the present weights."""
        now = [parameter.detach().clone() for parameter in network.parameters()]
        self.count += 1
        if self.values is None:
            self.values = now
        else:
            self.values = [old + (new - old) / self.count for old, new in zip(self.values, now)]

    @torch.no_grad()
    def copy_to(self, network):
        """Sets the weights of `network` to the mean."""
        for parameter, value in zip(network.parameters(), self.values):
            parameter.copy_(value)


@torch.no_grad()
def gather_statistics(network, run):
    """Running means and variances of batch norm over what `run()` runs, without dropout; leaves `network` in evaluation."""
    network.eval()
    norms = [module for module in network.modules() if isinstance(module, (nn.BatchNorm1d, nn.BatchNorm2d))]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # the plain mean over batches
        norm.train()
    if norms:
        run()
    network.eval()


def congruence(state):
    """Numbers below 2^31 of a linear congruence, without an end."""
    while True:
        state = (1103515245 * state + 12345) % 2**31
        yield state


def write(path, found):
    """Writes the JSON of `found` as a file for a test."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found) + "\n")


def agree(name, engine, torch_logits, rows, classes):
    """Whether both give the same, and a line that says so. `rows` and `classes` are the words for them."""
    scale = torch_logits.abs().amax(1, keepdim=True).clamp(min=1)
    difference = ((engine - torch_logits).abs() / scale).max().item()
    differ = int((engine.argmax(1) != torch_logits.argmax(1)).sum())
    print(f"{name}: {len(engine)} {rows}, {differ} {classes} differ, largest difference {difference:.1e}")
    return differ == 0 and difference <= MAX_DIFFERENCE


def parser(about, task, **positionals):
    """A command line: the paths `positionals` with their help, the folder of the weights of `task`, and the program."""
    made = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, text in positionals.items():
        made.add_argument(name, type=Path, help=text)
    made.add_argument("--weights", type=Path, default=Path(f"models/weights/{task}"), help="default: %(default)s")
    made.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return made
