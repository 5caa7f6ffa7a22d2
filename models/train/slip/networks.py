"""The networks for the direction of slip, with the tensors' names and layouts that the engine reads.

Enters: frames of (batch, steps, ...) as `meissner prepare slip` makes them. Leaves: 7 logits a window. What depends on
no state is computed for all steps at once, which changes the order of sums and nothing else.
"""

import torch
import torch.nn.functional as F
from torch import nn

CLASSES = 7
ELECTRODES = 24
HEIGHT, WIDTH = 12, 11


class Exported(nn.Module):
    """A network whose file holds its own tensors."""

    def exported(self):
        return dict(self.state_dict())

    def load_exported(self, tensors):
        self.load_state_dict(tensors, strict=False)


class Cell(nn.Module):
    """Weights of a convolutional LSTM with peepholes (the slip paper's Eq. 2), gates in the order i, f, g, o."""

    def __init__(self, inputs, hidden):
        super().__init__()
        self.inputs, self.hidden = inputs, hidden
        self.gates = nn.Conv2d(inputs + hidden, 4 * hidden, 3, padding=1)
        self.peephole = nn.Parameter(torch.zeros(3, hidden, HEIGHT, WIDTH))  # on i, f, o

    def forward(self, frames, gated):
        """Hidden maps of every step from `frames`, a list of (batch, inputs, 12, 11)."""
        last = {"memory_format": torch.channels_last}
        of_input, of_hidden = (part.contiguous(**last) for part in self.gates.weight.split([self.inputs, self.hidden], 1))
        from_input = F.conv2d(torch.cat(frames), of_input, self.gates.bias, padding=1).permute(0, 2, 3, 1)
        peephole = self.peephole.permute(0, 2, 3, 1).contiguous()
        cell = torch.zeros(len(frames[0]), HEIGHT, WIDTH, self.hidden)
        hidden = []
        for gates in from_input.chunk(len(frames)):
            if hidden:
                gates = gates + F.conv2d(hidden[-1], of_hidden, padding=1).permute(0, 2, 3, 1)
            output, cell = gated(gates, cell, peephole)
            hidden.append(output.permute(0, 3, 1, 2))
        return hidden


def gated(gates, cell, peephole):
    """One step of the state, channels last; the output gate looks at the cell before it, as the paper prints it."""
    i, f, g, o = gates.float().chunk(4, 3)
    i = torch.sigmoid(i + peephole[0] * cell)
    f = torch.sigmoid(f + peephole[1] * cell)
    o = torch.sigmoid(o + peephole[2] * cell)
    cell = f * cell + i * torch.tanh(g)
    return o * torch.tanh(cell), cell


class Head(Exported):
    """Two dense layers of 32 and the logits; batch norm behind the first, and dropout, where `dropout` is not 0."""

    def __init__(self, inputs, dropout):
        super().__init__()
        self.fc1, self.fc2, self.fc3 = nn.Linear(inputs, 32), nn.Linear(32, 32), nn.Linear(32, CLASSES)
        if dropout:
            self.norm = nn.BatchNorm1d(32)
        self.dropout = dropout

    def logits(self, x):
        x = self.fc1(x)
        x = F.relu(self.norm(x) if self.dropout else x)
        x = F.relu(self.fc2(F.dropout(x, self.dropout, self.training)))
        return self.fc3(F.dropout(x, self.dropout, self.training))


class SlipConvLstm(Head):
    """`depth` cells of 32 filters; the mean of each channel, or all values, into the head."""

    def __init__(self, depth, mean, dropout):
        super().__init__(32 if mean else 32 * HEIGHT * WIDTH, dropout)
        self.cells = nn.ModuleList(Cell(1 if i == 0 else 32, 32) for i in range(depth))
        self.mean = mean
        self.gated = gated

    def compiled(self):
        """Lets PyTorch fuse the gates: a fifth of the time of a step."""
        self.gated = torch.compile(gated)
        return self

    def forward(self, frames):
        x = [frames[:, step].contiguous(memory_format=torch.channels_last) for step in range(frames.shape[1])]
        for cell in self.cells:
            x = cell(x, self.gated)
        return self.logits(x[-1].mean((2, 3)) if self.mean else x[-1].flatten(1))


class SlipLstm(Head):
    """Three layers of LSTM with 32 units over readings of 24 electrodes."""

    def __init__(self):
        super().__init__(32, 0.3)
        self.lstm = nn.LSTM(ELECTRODES, 32, num_layers=3, batch_first=True)

    def forward(self, frames):
        return self.logits(self.lstm(frames)[0][:, -1])
