"""The frame networks as a PyTorch user writes them; names of parameters as in our weights files.

Images are (batch, channel, row, column), sequences (batch, step, ...). Sizes are those of the shipped descriptions.
"""
import torch
from torch import nn


class Cell(nn.Module):
    """Convolutional LSTM cell, gates i, f, g, o; with `peephole` weights on i, f and o if `size` is given."""

    def __init__(self, inputs, hidden, size=None):
        super().__init__()
        self.gates = nn.Conv2d(inputs + hidden, 4 * hidden, 3, padding=1)
        self.peephole = nn.Parameter(0.1 * torch.randn(3, hidden, *size)) if size else None

    def forward(self, x, h, c):
        i, f, g, o = self.gates(torch.cat((x, h), 1)).chunk(4, 1)
        if self.peephole is not None:
            i, f, o = (gate + weight * c for gate, weight in zip((i, f, o), self.peephole))
        c = f.sigmoid() * c + i.sigmoid() * g.tanh()
        return o.sigmoid() * c.tanh(), c


class ConvLstm(nn.Module):
    """Stacked cells over a sequence; the states of the last cell, step by step."""

    def __init__(self, depth, inputs, hidden, size, peephole):
        super().__init__()
        self.hidden = hidden
        widths = [inputs] + [hidden] * (depth - 1)
        self.cells = nn.ModuleList(Cell(width, hidden, size if peephole else None) for width in widths)

    def steps(self, frames):
        batch, count, _, height, width = frames.shape
        zeros = torch.zeros(batch, self.hidden, height, width)
        states = [(zeros, zeros) for _ in self.cells]
        for step in range(count):
            x = frames[:, step]
            for n, cell in enumerate(self.cells):
                states[n] = cell(x, *states[n])
                x = states[n][0]
            yield x


class Head(nn.Module):
    """Three dense layers, with or without batch norm after the first one."""

    def head(self, inputs, classes=7, norm=True):
        self.fc1, self.fc2, self.fc3 = nn.Linear(inputs, 32), nn.Linear(32, 32), nn.Linear(32, classes)
        self.norm = nn.BatchNorm1d(32) if norm else nn.Identity()

    def classify(self, x):
        return self.fc3(self.fc2(self.norm(self.fc1(x)).relu()).relu())


class SlipConvLstm(ConvLstm, Head):
    def __init__(self, tuned):
        super().__init__(5 if tuned else 3, 1, 32, (12, 11), True)
        self.tuned = tuned
        self.head(32 if tuned else 32 * 12 * 11, norm=not tuned)

    def forward(self, frames):
        *_, x = self.steps(frames)
        return self.classify(x.mean((2, 3)) if self.tuned else x.flatten(1))


class SlipLstm(Head):
    def __init__(self):
        super().__init__()
        self.lstm = nn.LSTM(24, 32, num_layers=3, batch_first=True)
        self.head(32)

    def forward(self, readings):
        return self.classify(self.lstm(readings)[0][:, -1])


class ForceConvLstm(ConvLstm):
    def __init__(self):
        super().__init__(4, 2, 3, (115, 115), False)
        self.fc = nn.Linear(3 * 115 * 115, 1)

    def forward(self, frames):
        return torch.stack([self.fc(x.flatten(1)) for x in self.steps(frames)], 1)


class EventFrameCnn(nn.Module):
    def __init__(self):
        super().__init__()
        widths = [1, 32, 32, 32, 128, 128, 256]
        self.convs = nn.ModuleList(nn.Conv2d(a, b, 3, padding=1) for a, b in zip(widths, widths[1:]))
        sizes = [256 * 4 * 5, 256, 128, 64, 2]
        self.dense = nn.ModuleList(nn.Linear(a, b) for a, b in zip(sizes, sizes[1:]))

    def forward(self, x):
        for conv in self.convs:
            x = nn.functional.max_pool2d(conv(x).relu(), 2)
        x = x.flatten(1)
        for layer in self.dense[:-1]:
            x = layer(x).relu()
        return self.dense[-1](x)


class Squeeze(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.down = nn.Linear(channels, channels // 16, bias=False)
        self.up = nn.Linear(channels // 16, channels, bias=False)

    def forward(self, x):
        return x * self.up(self.down(x.mean((2, 3))).relu()).sigmoid()[:, :, None, None]


class Twice(nn.Module):
    """Convolution, batch norm, ReLU; twice."""

    def __init__(self, inputs, outputs, squeeze):
        super().__init__()
        self.conv1, self.bn1 = nn.Conv2d(inputs, outputs, 3, padding=1, bias=False), nn.BatchNorm2d(outputs)
        self.conv2, self.bn2 = nn.Conv2d(outputs, outputs, 3, padding=1, bias=False), nn.BatchNorm2d(outputs)
        self.squeeze = Squeeze(outputs) if squeeze else nn.Identity()

    def forward(self, x):
        return self.squeeze(self.bn2(self.conv2(self.bn1(self.conv1(x)).relu())).relu())


class Canf(nn.Module):
    """U-Net of 32, 64, 128 and 256 channels."""

    def __init__(self, squeeze):
        super().__init__()
        sizes = [3, 32, 64, 128, 256]
        self.down = nn.ModuleList(Twice(a, b, squeeze) for a, b in zip(sizes, sizes[1:]))
        rising = list(zip(sizes[:1:-1], sizes[-2:0:-1]))
        self.lift = nn.ModuleList(nn.ConvTranspose2d(a, b, 2, 2) for a, b in rising)
        self.up = nn.ModuleList(Twice(a, b, squeeze) for a, b in rising)
        self.head = nn.Conv2d(32, 1, 1)

    def forward(self, x):
        kept = []
        for block in self.down:
            x = block(nn.functional.max_pool2d(x, 2) if kept else x)
            kept.append(x)
        kept.pop()
        for lift, block in zip(self.lift, self.up):
            x = block(torch.cat((lift(x), kept.pop()), 1))
        return self.head(x)


class Once(nn.Module):
    """Convolution, batch norm, ReLU."""

    def __init__(self, inputs, outputs, kernel=3):
        super().__init__()
        self.conv, self.bn = nn.Conv2d(inputs, outputs, kernel, padding=kernel // 2, bias=False), nn.BatchNorm2d(outputs)

    def forward(self, x):
        return self.bn(self.conv(x)).relu()


class CanfLive(Canf):
    """U-Net of 16, 32, 64 and 128 channels at half resolution, between 8 channels at full resolution."""

    def __init__(self):
        nn.Module.__init__(self)
        sizes = [3, 8, 16, 32, 64, 128]
        self.down = nn.ModuleList(Once(a, b) if b < 32 else Twice(a, b, False) for a, b in zip(sizes, sizes[1:]))
        rising = list(zip(sizes[:1:-1], sizes[-2:0:-1]))
        self.lift = nn.ModuleList(nn.ConvTranspose2d(a, b, 2, 2) for a, b in rising)
        self.up = nn.ModuleList(Once(a, b, 1 if b == 8 else 3) for a, b in rising)
        self.head = nn.Conv2d(8, 1, 1)


# Name: (constructor, shape of an input without the batch).
NETWORKS = {
    "canf": (lambda: Canf(True), (3, 240, 320)),
    "canf-live": (CanfLive, (3, 240, 320)),
    "canf-plain": (lambda: Canf(False), (3, 240, 320)),
    "slip-tuned": (lambda: SlipConvLstm(True), (5, 1, 12, 11)),
    "slip-regularised": (lambda: SlipConvLstm(False), (5, 1, 12, 11)),
    "slip-lstm": (SlipLstm, (5, 24)),
    "force-convlstm": (ForceConvLstm, (41, 2, 115, 115)),
    "event-frame-cnn": (EventFrameCnn, (1, 260, 346)),
}
