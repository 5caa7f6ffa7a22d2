"""The package as a whole: its stubs, its docstrings, and the programs of the README."""

import ast
import inspect
import re
from pathlib import Path

import pytest
from conftest import make_events
from test_evaluate import write_digit

import meissner
from meissner import _meissner

PACKAGE = Path(meissner.__file__).parent
README = Path(__file__).parents[1] / "README.md"


def stub_names():
    names = {}
    for node in ast.parse((PACKAGE / "_meissner.pyi").read_text()).body:
        if isinstance(node, ast.ClassDef):
            # Shared code of the stubs; a class of the module has its base's methods from there.
            ids = [base.value.id if isinstance(base, ast.Subscript) else base.id for base in node.bases]
            bases = [names[name] for name in ids if name.startswith("_")]
            methods = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
            names[node.name] = methods.union(*bases)
        elif isinstance(node, ast.FunctionDef):
            names[node.name] = set()
    return {name: methods for name, methods in names.items() if not name.startswith("_")}


def test_the_stubs_have_what_the_module_has():
    stubs = stub_names()
    # Members of every object, and methods of `object` in the stubs.
    common = set(dir(object)) | {"__module__", "__weakref__"}
    public = {name: value for name, value in vars(_meissner).items() if not name.startswith("_") and callable(value)}
    assert set(stubs) == set(public)
    for name, value in public.items():
        if inspect.isclass(value):
            found = {method for method in vars(value) if method not in common or method in ("__new__",)}
            found -= {"__doc__", "__new__", "__str__", "__lt__", "__le__", "__gt__", "__ge__", "__ne__"}
            wanted = {method for method in stubs[name] if method not in common}
            assert wanted == found, name


def test_everything_public_has_a_docstring():
    for name in meissner.__all__:
        value = getattr(meissner, name)
        if inspect.ismodule(value):
            for part in value.__all__:
                assert (getattr(value, part).__doc__ or "").strip(), f"{name}.{part}"
            continue
        if name in ("__version__", "EVENT_DTYPE", "SIMULATED_DTYPE", "CAUSES"):
            continue
        assert (value.__doc__ or "").strip(), name
        if inspect.isclass(value) and not issubclass(value, Exception):
            for method, member in vars(value).items():
                if not method.startswith("_"):
                    assert (member.__doc__ or "").strip(), f"{name}.{method}"


def test_exceptions_are_of_the_module_and_derive_from_error():
    classes = [value for value in vars(meissner).values() if isinstance(value, type) and issubclass(value, Exception)]
    assert len(classes) == 14
    assert issubclass(meissner.MeissnerWarning, UserWarning) and meissner.MeissnerWarning.__module__ == "meissner"
    classes.remove(meissner.MeissnerWarning)
    for one in classes:
        assert issubclass(one, meissner.Error)
        assert one.__module__ == "meissner"


def programs():
    return re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)


@pytest.mark.parametrize("program", programs(), ids=lambda program: program.strip().splitlines()[-1][:40])
def test_the_programs_of_the_readme_run(program, tmp_path, monkeypatch, capsys):
    for name in ("torch_geometric", "torch"):
        if name in program:
            pytest.importorskip(name)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "RECORDING").symlink_to(README.parents[2] / "run" / "assets" / "dome_press.evt3")
    for digit in range(10 if "NMNIST" in program else 0):
        write_digit(tmp_path / f"NMNIST/test/{digit}/00001.bin", make_events(100, digit, (34, 34)))
    exec(compile(program, "README.md", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out
