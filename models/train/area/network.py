"""The U-Net of `canf` and `canf-plain`, with the names of the shipped weights."""

import torch
from torch import nn
from torch.nn import functional

CHANNELS = (32, 64, 128, 256)
# A channel of squeeze-and-excitation stands for so many of the block.
REDUCTION = 16


class SqueezeExcite(nn.Module):
    """Scales each channel by a factor that the means of all channels determine."""

    def __init__(self, channels):
        super().__init__()
        self.down = nn.Linear(channels, channels // REDUCTION, bias=False)
        self.up = nn.Linear(channels // REDUCTION, channels, bias=False)

    def forward(self, image):
        factors = torch.sigmoid(self.up(torch.relu(self.down(image.mean((2, 3))))))
        return image * factors[:, :, None, None]


class Block(nn.Module):
    """Two convolutions with batch norm, and squeeze-and-excitation where `squeezes`."""

    def __init__(self, inputs, outputs, squeezes):
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        self.squeeze = SqueezeExcite(outputs) if squeezes else nn.Identity()

    def forward(self, image):
        image = torch.relu(self.bn1(self.conv1(image)))
        return self.squeeze(torch.relu(self.bn2(self.conv2(image))))


class Network(nn.Module):
    """Images (n, 3, H, W), H and W multiples of 8, to maps (n, 1, H, W)."""

    def __init__(self, squeezes):
        super().__init__()
        first, *others = CHANNELS
        up = CHANNELS[::-1]
        widths = [(3, first), *zip(CHANNELS, others)]
        self.down = nn.ModuleList(Block(inputs, outputs, squeezes) for inputs, outputs in widths)
        self.lift = nn.ModuleList(nn.ConvTranspose2d(a, b, 2, 2) for a, b in zip(up, up[1:]))
        self.up = nn.ModuleList(Block(a, b, squeezes) for a, b in zip(up, up[1:]))
        self.head = nn.Conv2d(first, 1, 1)

    def forward(self, image):
        kept = []
        for block in self.down:
            image = block(functional.max_pool2d(image, 2) if kept else image)
            kept.append(image)
        for lift, block, skip in zip(self.lift, self.up, kept[-2::-1]):
            image = block(torch.cat([lift(image), skip], 1))
        return self.head(image)


def squeezing(plain):
    """A network with squeeze-and-excitation that computes what `plain` does: the factors begin at a half, and batch norm at twice as
    much."""
    network = Network(True)
    network.load_state_dict(plain.state_dict(), strict=False)
    for block in [*network.down, *network.up]:
        nn.init.zeros_(block.squeeze.up.weight)
        with torch.no_grad():
            block.bn2.weight.mul_(2)
            block.bn2.bias.mul_(2)
    return network
