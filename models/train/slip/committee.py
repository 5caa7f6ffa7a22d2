"""`slip-best`: a committee of small networks over two views of the electrodes, as one network.

Three members read the shape of a reading alone (scaled by its own range) through an LSTM; three read the sensor's counts
(scaled by a fixed range), all five readings at once, through dense layers. Each has a loss of its own; the prediction is
the mean of their logits. The members lie beside each other in wide layers whose weights between members are zero: they
start so, and no gradient reaches them.
"""

import math

import torch
import torch.nn.functional as F
from networks import CLASSES, ELECTRODES
from torch import nn

MEMBERS = 3  # of each kind
STEPS = 5
LSTM, LSTM_DENSE, DENSE = 64, 32, 64  # widths of a member
# Counts that become 1 in the first dense layers: about the spread of an electrode over the training set.
SPREAD = 100.0
DROPOUT = 0.3


class SlipBest(nn.Module):
    """Logits of (batch, 5, 48) frames: 24 values scaled by the reading's range, 24 by `span` counts.

    `frames` are those of the training set: the mean of each electrode is taken out before the first dense layer. Without
    them the weights must be exported ones, which have that in them already."""

    def __init__(self, frames=None, span=1832.0):
        super().__init__()
        wide, narrow = MEMBERS * DENSE, MEMBERS * LSTM_DENSE
        self.lstm = nn.LSTM(2 * ELECTRODES, MEMBERS * LSTM, batch_first=True)
        self.shape1, self.shape_norm = nn.Linear(MEMBERS * LSTM, narrow), nn.BatchNorm1d(narrow)
        self.shape2 = nn.Linear(narrow, narrow)
        self.counts1, self.counts_norm1 = nn.Linear(STEPS * 2 * ELECTRODES, wide), nn.BatchNorm1d(wide)
        self.counts2, self.counts_norm2 = nn.Linear(wide, wide), nn.BatchNorm1d(wide)
        self.out = nn.Linear(wide + narrow, CLASSES)
        self.mean = torch.zeros(2 * ELECTRODES) if frames is None else frames.mean((0, 1))
        self.gain = 1.0 if frames is None else span / SPREAD
        self.separate()

    def separate(self):
        """Draws the weights member by member, and keeps those between members at zero."""
        eye = torch.eye(MEMBERS)
        shape, counts = torch.eye(2).repeat_interleave(ELECTRODES, 1)
        gates = torch.kron(eye, torch.ones(LSTM, LSTM)).repeat(4, 1)
        start(self.lstm.weight_ih_l0, shape.expand(4 * MEMBERS * LSTM, -1), LSTM)
        start(self.lstm.weight_hh_l0, gates, LSTM)
        start(self.shape1.weight, torch.kron(eye, torch.ones(LSTM_DENSE, LSTM)), LSTM)
        start(self.shape2.weight, torch.kron(eye, torch.ones(LSTM_DENSE, LSTM_DENSE)), LSTM_DENSE)
        start(self.counts1.weight, counts.repeat(STEPS).expand(MEMBERS * DENSE, -1), STEPS * ELECTRODES)
        start(self.counts2.weight, torch.kron(eye, torch.ones(DENSE, DENSE)), DENSE)
        start(self.out.weight, torch.ones_like(self.out.weight), DENSE)

    def forward(self, frames):
        """Logits of each member while training, (members, batch, 7); else their mean."""
        drop = lambda x: F.dropout(x, DROPOUT, self.training)
        shape = drop(F.relu(self.shape_norm(self.shape1(self.lstm(frames)[0][:, -1]))))
        shape = drop(F.relu(self.shape2(shape)))
        counts = ((frames - self.mean) * self.gain).flatten(1)
        counts = drop(F.relu(self.counts_norm1(self.counts1(counts))))
        counts = drop(F.relu(self.counts_norm2(self.counts2(counts))))
        hidden = [*counts.split(DENSE, 1), *shape.split(LSTM_DENSE, 1)]
        weights = self.out.weight.split([DENSE] * MEMBERS + [LSTM_DENSE] * MEMBERS, 1)
        logits = torch.stack([F.linear(x, weight, self.out.bias) for x, weight in zip(hidden, weights)])
        return logits if self.training else logits.mean(0)

    def exported(self):
        """Tensors of the plain network: the mean and the gain of the inputs in the first dense layer, that of the members
        in the last; and the engine's delay holds value after value, each over time."""
        tensors = dict(self.state_dict())
        weight = self.counts1.weight * self.gain
        tensors["counts1.weight"] = weight.unflatten(1, (STEPS, -1)).transpose(1, 2).flatten(1)
        tensors["counts1.bias"] = self.counts1.bias - weight @ self.mean.repeat(STEPS)
        tensors["out.weight"] = self.out.weight / (2 * MEMBERS)
        return tensors

    def load_exported(self, tensors):
        """The weights of a file."""
        weight = tensors["counts1.weight"].unflatten(1, (-1, STEPS)).transpose(1, 2).flatten(1)
        own = {"counts1.weight": weight, "out.weight": tensors["out.weight"] * (2 * MEMBERS)}
        self.load_state_dict(tensors | own, strict=False)


def start(weight, mask, inputs):
    """Uniform within 1 / sqrt(inputs of a member), as PyTorch draws layers, and 0 for ever where `mask` is 0."""
    with torch.no_grad():
        weight.uniform_(-1 / math.sqrt(inputs), 1 / math.sqrt(inputs)).mul_(mask)
    weight.register_hook(lambda gradient: gradient * mask)
