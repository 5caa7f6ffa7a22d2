"""What is trained, and how: the slip paper's three networks with the paper's settings (batches of 32, 30 epochs, Adam at
0.001), and `slip-best`, chosen by cross-validation grouped by recording (see README.md)."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from committee import SlipBest
from networks import SlipConvLstm, SlipLstm
from torch import nn


@dataclass
class Recipe:
    """How a network is made, of the frames that it is trained on or of none, and how it is trained: `l2` is the factor of
    the sum of squares of the weights in the loss."""

    network: Callable[[torch.Tensor | None], nn.Module]
    epochs: int = 30
    batch: int = 32
    rate: float = 0.001
    l2: float = 0.0
    smoothing: float = 0.0


RECIPES = {
    "slip-tuned": Recipe(lambda _: SlipConvLstm(depth=5, mean=True, dropout=0.0).compiled()),
    "slip-regularised": Recipe(lambda _: SlipConvLstm(depth=3, mean=False, dropout=0.3).compiled(), l2=0.001),
    "slip-lstm": Recipe(lambda _: SlipLstm(), l2=0.001),
    "slip-best": Recipe(SlipBest, epochs=40, batch=64, rate=0.002, l2=0.0005, smoothing=0.05),
}
