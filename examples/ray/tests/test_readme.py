"""The commands and the program of the README run as they stand."""

import re
import shlex
from pathlib import Path

import meissner
from conftest import DAVIS, make_events, write_digits, write_slips

from meissner_ray.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text()


def test_the_commands_and_the_program_of_the_readme_run(cluster, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_digits(Path("NMNIST"))
    write_slips(Path("SLIPS"))
    Path("RECORDINGS").mkdir()
    meissner.write("RECORDINGS/one.npy", make_events(600, 1, DAVIS), DAVIS)
    commands = [shlex.split(line) for line in re.findall(r"^python -m meissner_ray (.*)$", README, re.MULTILINE)]
    assert len(commands) >= 4
    for command in commands:
        # Ray is already running.
        asked = [word for i, word in enumerate(command) if "--workers" not in command[max(0, i - 1) : i + 1]]
        if asked[1] == "angle":
            asked += ["--sensor", "346x260", "--repeats", "1"]
        assert main(asked) == 0, (command, capsys.readouterr().err)
    assert "computed: 10000 such recordings" in capsys.readouterr().out
    for program in re.findall(r"^```python\n(.*?)^```$", README, re.MULTILINE | re.DOTALL):
        exec(program, {})
    assert capsys.readouterr().out.startswith("digits-past 10 ")
