"""Signed frames of events over a sliding window, as frame networks over events read them."""

from dataclasses import dataclass

import numpy as np
import torch


class Frames:
    """Streams of events, for the frame network that `inspected` described."""

    def __init__(self, said, sensor, streams):
        source = said["source"]
        assert source["rule"] == "sum" and said["input"] == [1, sensor[1], sensor[0]], said
        self.span_us, self.sensor, self.streams = source["span_us"], sensor, streams

    def part(self, streams):
        """The events of `streams`, a range of their numbers."""
        part = Frames.__new__(Frames)
        part.span_us, part.sensor, part.streams = self.span_us, self.sensor, [self.streams[i] for i in streams]
        return part

    def read(self, times, mirrors=(), shift=(0, 0)):
        """Frames (streams x readouts, 1, height, width) at `times` (streams, readouts): sums of the polarities, 1 or -1, of the
        events of each pixel. The image is mirrored along columns or rows, then shifted by pixels."""
        width, height = self.sensor
        frames = np.zeros((times.size, height * width), np.float32)
        for i, events in enumerate(self.streams):
            t_us, x, y, on = events.T
            x = width - 1 - x if "columns" in mirrors else x
            y = height - 1 - y if "rows" in mirrors else y
            x, y = x + shift[0], y + shift[1]
            there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            for j, end in enumerate(times[i]):
                inside = there & (t_us <= end) & (t_us >= end - self.span_us)
                sums = np.bincount(y[inside] * width + x[inside], 2.0 * on[inside] - 1, height * width)
                frames[i * times.shape[1] + j] = sums
        return Images(torch.from_numpy(frames).view(-1, 1, height, width))


@dataclass
class Images:
    """A batch of frames."""

    input: torch.Tensor  # (readouts, channels, height, width)
