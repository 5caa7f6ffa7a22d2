"""What `export_weights.py` promises: `python -m unittest discover train`, with the packages of models/train/slip/requirements.txt."""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import torch
from safetensors import safe_open
from torch import nn

sys.path.append(str(Path(__file__).resolve().parent))
from export_weights import Misfit, export, fitting, read


class Block(nn.Module):
    """The tensors of a spline block with root weight and bias, by the names of torch_geometric."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.conv = nn.Module()
        self.conv.weight = nn.Parameter(torch.randn(8, inputs, outputs))
        self.conv.lin = nn.Linear(inputs, outputs, bias=False)
        self.conv.register_buffer("kernel_size", torch.tensor([2, 2, 2]))
        self.norm = nn.BatchNorm1d(outputs)


class Net(nn.Module):
    def __init__(self):
        super().__init__()
        self.blocks = nn.ModuleList([Block(1, 8), Block(8, 4)])
        self.fc = nn.Linear(16, 2)


def listed(module, **more):
    """What `meissner inspect --json` would list for `module`."""
    shapes = {n: list(t.shape) for n, t in module.state_dict().items() if t.is_floating_point()}
    return {"name": "net", "tensors": [{"name": n, "shape": s} for n, s in shapes.items()], **more}


class Export(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder, self.net = Path(folder.name), Net()
        self.out = self.folder / "net.safetensors"

    def written(self):
        with safe_open(self.out, "pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata()

    def test_a_module_is_written_with_metadata_and_without_bookkeeping(self):
        network = listed(self.net, preparation='{"frames":"electrodes"}')
        self.assertEqual(export(self.net, network, self.out, {"stride": 2}), [])
        tensors, metadata = self.written()
        self.assertEqual(sorted(tensors), sorted(t["name"] for t in network["tensors"]))
        for name, tensor in tensors.items():
            self.assertTrue(torch.equal(tensor, self.net.state_dict()[name]), name)
        expected = {"network": "net", "trained": "true", "preparation": '{"frames":"electrodes"}', "stride": "2"}
        self.assertEqual(metadata, expected)

    def test_what_is_missing_is_named_with_what_is_left_over_of_its_shape(self):
        network = listed(self.net)
        tensors = dict(self.net.state_dict())
        tensors["head.weight"] = tensors.pop("fc.weight")
        with self.assertRaisesRegex(Misfit, r"fc\.weight: missing.*\(2, 16\).*head\.weight"):
            export(tensors, network, self.out)
        self.assertFalse(self.out.exists())
        export(tensors, network, self.out, names={"head.": "fc."})

    def test_the_longest_prefix_renames_and_two_of_one_name_are_refused(self):
        network = listed(self.net)
        tensors = {f"module.{n}".replace("blocks.1", "last"): t for n, t in self.net.state_dict().items()}
        export(tensors, network, self.out, names={"module.": "", "module.last.": "blocks.1."})
        with self.assertRaisesRegex(Misfit, "two tensors"):
            export(tensors, network, self.out, names={"module.": "", "module.last.": "blocks.0."})

    def test_other_shapes_types_and_values_are_refused_by_name(self):
        network = listed(self.net)
        for name, tensor, message in [
            ("fc.weight", torch.zeros(16, 2), r"\(2, 16\), found \(16, 2\)"),
            ("fc.bias", torch.zeros(2, dtype=torch.int64), "floating-point"),
            ("fc.bias", torch.tensor([0.0, torch.nan]), "finite"),
            ("fc.bias", torch.tensor([0.0, 1e300], dtype=torch.float64), "finite F32"),
        ]:
            with self.assertRaisesRegex(Misfit, f"{name}.*{message}"):
                fitting(dict(self.net.state_dict()) | {name: tensor}, network)

    def test_half_precision_is_refused_where_it_would_be_infinite(self):
        tensors = dict(self.net.state_dict()) | {"blocks.1.conv.weight": torch.full((8, 8, 4), 1e5)}
        export(tensors, listed(self.net), self.out)
        with self.assertRaisesRegex(Misfit, "blocks.1.conv.weight.*finite"):
            export(tensors, listed(self.net), self.out, half=True)

    def test_the_command_reads_a_checkpoint_and_says_what_it_left(self):
        checkpoint, description = self.folder / "net.pth", self.folder / "net.json"
        state = dict(self.net.state_dict()) | {"spare": torch.zeros(3)}
        torch.save({"epoch": 3, "state_dict": state}, checkpoint)
        self.assertEqual(read(checkpoint).keys(), state.keys())
        description.write_text(json.dumps(listed(self.net)))
        script = Path(__file__).with_name("export_weights.py")
        command = [sys.executable, script, checkpoint, description, self.out]
        done = subprocess.run([*command, "--about", "a test", "--remark", "sensor=[34, 34]"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("not read by the network: spare", done.stderr)
        _, metadata = self.written()
        self.assertEqual((metadata["about"], metadata["sensor"]), ("a test", "[34, 34]"))


if __name__ == "__main__":
    unittest.main()
