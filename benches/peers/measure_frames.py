"""Times the peers on one frame network: `measure_frames.py NETWORK FILE [--export] [--runs N]`, called by frames.py.

With --export writes weights, an input x and PyTorch's answer y. Otherwise prints one JSON object: median milliseconds of
ONNX Runtime and of PyTorch on that file.
"""
import argparse
import io
import json
import warnings

import torch
from safetensors.torch import load_file, save_file

from measure import measure
from networks import NETWORKS


def drawn(name):
    """The network with weights from a seed: PyTorch's initial weights, and running statistics that differ from those of a new network."""
    torch.manual_seed(0)
    constructor, shape = NETWORKS[name]
    network = constructor().eval()
    for key, value in network.state_dict().items():
        if key.endswith("running_mean"):
            value.uniform_(-0.1, 0.1)
        elif key.endswith("running_var"):
            value.uniform_(0.5, 1.5)
    return network, torch.rand(1, *shape)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("network")
    parser.add_argument("file")
    parser.add_argument("--export", action="store_true")
    parser.add_argument("--runs", type=int, default=15)
    args = parser.parse_args()
    torch.set_num_threads(1)
    network, x = drawn(args.network)
    if args.export:
        with torch.inference_mode():
            y = network(x)
        state = {key: value.float() for key, value in network.state_dict().items() if "num_batches" not in key}
        save_file({**state, "x": x, "y": y}, args.file)
        return
    tensors = load_file(args.file)
    x, y = tensors.pop("x"), tensors.pop("y")
    network.load_state_dict(tensors, strict=False)
    import onnxruntime
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(network, (x,), buffer, input_names=["x"], output_names=["y"], dynamo=False)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(buffer.getvalue(), options, providers=["CPUExecutionProvider"])
    value = x.numpy()
    answer = torch.from_numpy(session.run(None, {"x": value})[0])
    assert (answer - y).abs().max() <= 1e-4 * y.abs().max(), "ONNX Runtime and PyTorch disagree"
    with torch.inference_mode():
        mine = measure(lambda: network(x), args.runs)
    versions = {"torch": torch.__version__, "onnxruntime": onnxruntime.__version__}
    theirs = measure(lambda: session.run(None, {"x": value}), args.runs)
    print(json.dumps(dict(onnxruntime=theirs, torch=mine, versions=versions)))


if __name__ == "__main__":
    main()
