"""The dense layers, trained further while the rest of the network stays.

The features of a press are strongly correlated: how deep it is moves all of them, its angle moves differences of a few. In their
principal components, scaled to similar variance, such differences are learned as fast as the depth. The components are then folded
into the first dense layer.
"""

import numpy as np
import torch
import torch.nn.functional as F
from fit import batches
from network import ACTIVATIONS

BATCH = 128
RATE = 0.001
FLOOR = 1e-3  # of the largest variance: it is added to each, so that noise is not learned as fast


def refit(network, data, settings, random, epochs, log=print):
    """Trains the two dense layers of `network` on the features of `data`, each press read as in training."""
    network.eval()
    with torch.no_grad():
        order = random.permutation(len(data[0]))
        pairs = [(network.features(batch), target) for batch, target in batches(data, order, settings, random)]
        features, targets = (torch.cat(each) for each in zip(*pairs))
        mean = features.mean(0)
        variance, axes = torch.linalg.eigh(torch.cov((features - mean).T))
        scale = (variance + FLOOR * variance.max()).sqrt()
        components = (features - mean) @ (axes / scale)
        layers = [layer for layer in network.layers if layer["kind"] == "dense"]
        (hidden, last), activation = (network.part[layer["name"]] for layer in layers), ACTIVATIONS[layers[0]["activation"]]
        first = torch.nn.Linear(len(scale), hidden.out_features)
        first.weight.copy_(hidden.weight @ (axes * scale))
        first.bias.copy_(hidden.bias + hidden.weight @ mean)
    optimiser = torch.optim.Adam([*first.parameters(), *last.parameters()], RATE)
    order = np.arange(len(components))
    for epoch in range(epochs):
        random.shuffle(order)
        total = 0.0
        for group in optimiser.param_groups:
            group["lr"] = RATE * (1 - epoch / epochs)
        for i in range(0, len(order), BATCH):
            part = torch.from_numpy(order[i : i + BATCH])
            loss = F.smooth_l1_loss(last(activation(first(components[part]))), targets[part], beta=settings.beta)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += loss.item() * len(part)
        log(f"dense layers, epoch {epoch + 1:3}  loss {total / len(order):.5f}")
    with torch.no_grad():
        hidden.weight.copy_(first.weight @ (axes / scale).T)
        hidden.bias.copy_(first.bias - hidden.weight @ mean)
