"""The four frame networks for contact force, with the tensors' names and layouts that the engine reads.

Enters: frames (batch, steps, 2, rows, columns) of counts, divided by the maximum. Leaves: force (batch, steps) in newtons.

The dense layer behind the ConvLSTM reads all 39,675 values of the last cell. In training its weights are a coarse picture, linear between
23 x 23 places: 900 recordings cannot teach each of them alone. The same weights then fit pictures of other sizes, so that a training can
begin on every fifth pixel.
"""

import torch
import torch.nn.functional as F
from torch import nn

SIDE = 115
PLACES = 23
# A forget gate that begins almost open keeps what came before (Jozefowicz et al. 2015, section 3.2).
FORGET = 2.0


class ForceConvLstm(nn.Module):
    """Four cells of three filters, without peepholes, and a dense layer."""

    def __init__(self, filters=3):
        super().__init__()
        self.filters = filters
        self.gates = nn.ModuleList(nn.Conv2d((2 if i == 0 else filters) + filters, 4 * filters, 3, padding=1) for i in range(4))
        for gates in self.gates:
            nn.init.constant_(gates.bias[filters : 2 * filters], FORGET)
        self.map = nn.Parameter(torch.randn(1, filters, PLACES, PLACES) * 0.05)
        # The weights of a file, instead of those of the map.
        self.whole = None
        self.bias = nn.Parameter(torch.zeros(1))

    def forward(self, frames):
        batch, steps, _, height, width = frames.shape
        dense = self.dense(height, width).flatten()
        state = [(frames.new_zeros(batch, self.filters, height, width),) * 2 for _ in self.gates]
        found = []
        for step in range(steps):
            x = frames[:, step]
            for n, gates in enumerate(self.gates):
                h, c = state[n]
                i, f, g, o = gates(torch.cat([x, h], 1)).chunk(4, 1)
                c = torch.sigmoid(f) * c + torch.sigmoid(i) * torch.tanh(g)
                x = torch.sigmoid(o) * torch.tanh(c)
                state[n] = x, c
            found.append(x.flatten(1) @ dense)
        return torch.stack(found, 1) + self.bias

    def dense(self, height, width):
        """The weights of the dense layer for pictures of this size: a mean over pixels times the number of places."""
        if self.whole is not None:
            return self.whole
        grown = F.interpolate(self.map, (height, width), mode="bilinear", align_corners=False)
        return grown * (PLACES * PLACES / (height * width))

    def exported(self):
        tensors = {f"cells.{n}.gates.{name}": tensor for n, gates in enumerate(self.gates) for name, tensor in gates.named_parameters()}
        return tensors | {"fc.weight": self.dense(SIDE, SIDE).reshape(1, -1), "fc.bias": self.bias}

    def load_exported(self, tensors):
        for n, gates in enumerate(self.gates):
            gates.load_state_dict({name: tensors[f"cells.{n}.gates.{name}"] for name in ("weight", "bias")})
        self.whole, self.bias.data = tensors["fc.weight"], tensors["fc.bias"]

    def learn_on(self):
        """Makes the weights of a file a map again, so that they can be trained further."""
        whole = self.whole.view(1, self.filters, SIDE, SIDE) * (SIDE * SIDE / (PLACES * PLACES))
        self.map.data, self.whole = F.interpolate(whole, (PLACES, PLACES), mode="area"), None


class Exported(nn.Module):
    """A network whose file holds its own tensors."""

    def exported(self):
        return dict(self.state_dict())

    def load_exported(self, tensors):
        self.load_state_dict(tensors)

    def learn_on(self):
        """Nothing has to change."""


class ForceCnnLstm(Exported):
    """Four convolutions of three filters with pooling, an LSTM of 32 and a dense layer."""

    def __init__(self):
        super().__init__()
        widths = [2, 3, 3, 3, 3]
        self.convs = nn.ModuleList(nn.Conv2d(a, b, 3, padding=1) for a, b in zip(widths, widths[1:]))
        # A kernel begins as a positive blur, mostly of one channel: no rectifier is closed, and polarities stay apart.
        for conv in self.convs:
            nn.init.uniform_(conv.weight, 0.0, 0.1)
            nn.init.zeros_(conv.bias)
            for channel in range(2):
                nn.init.uniform_(conv.weight[channel, channel], 0.2, 0.4)
        self.lstm, self.fc = nn.LSTM(3 * 7 * 7, 32, batch_first=True), nn.Linear(32, 1)
        forgetful(self.lstm)

    def forward(self, frames):
        return self.over(self.features(frames))

    def features(self, frames):
        """What the convolutions make of each frame: (batch, steps, 147)."""
        x = frames.flatten(0, 1)
        for conv in self.convs:
            x = F.max_pool2d(F.relu(conv(x)), 2)
        return x.reshape(*frames.shape[:2], -1)

    def over(self, features):
        return self.fc(self.lstm(features)[0])[..., 0]


class ForceLstm(Exported):
    """Six LSTM layers of 32 over means of 5 x 5 pixels, and a dense layer."""

    def __init__(self):
        super().__init__()
        self.lstm, self.fc = nn.LSTM(2 * PLACES * PLACES, 32, num_layers=6, batch_first=True), nn.Linear(32, 1)
        forgetful(self.lstm)

    def forward(self, frames):
        batch, steps = frames.shape[:2]
        x = F.avg_pool2d(frames.flatten(0, 1), 5) if frames.shape[-1] == SIDE else frames
        return self.fc(self.lstm(x.reshape(batch, steps, -1))[0])[..., 0]


class ForceTdnn(Exported):
    """The counts of the last three frames through two dense layers of 32."""

    # Sums of thousands of counts are learned in this unit.
    COUNTS = 100.0

    def __init__(self, delays=3):
        super().__init__()
        self.delays = delays
        self.fc1, self.fc2, self.fc3 = nn.Linear(2 * delays, 32), nn.Linear(32, 32), nn.Linear(32, 1)

    def forward(self, frames):
        totals = (frames.sum((3, 4)) if frames.dim() == 5 else frames) / self.COUNTS
        counts = F.pad(totals, (0, 0, self.delays - 1, 0))
        x = counts.unfold(1, self.delays, 1).flatten(2)
        return self.fc3(F.relu(self.fc2(F.relu(self.fc1(x)))))[..., 0]

    def exported(self):
        return super().exported() | {"fc1.weight": self.fc1.weight / self.COUNTS}

    def load_exported(self, tensors):
        super().load_exported(tensors | {"fc1.weight": tensors["fc1.weight"] * self.COUNTS})


def forgetful(lstm):
    """Opens the forget gates."""
    for name, parameter in lstm.named_parameters():
        if "bias_ih" in name:
            hidden = len(parameter) // 4
            nn.init.constant_(parameter[hidden : 2 * hidden], FORGET)


NETWORKS = {"force-convlstm": ForceConvLstm, "force-cnnlstm": ForceCnnLstm, "force-lstm": ForceLstm, "force-tdnn": ForceTdnn}
