"""The snippets of README.md run, in their order, as a new user types them."""
import re
from pathlib import Path

import msim
import pytest

README = Path(__file__).resolve().parents[1] / "README.md"


def test_snippets(tmp_path, monkeypatch, capsys):
    for module in "scipy", "distributed", "pandas":
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    names = {}
    snippets = re.findall(r"```python\n(.*?)```", README.read_text(), re.S)
    assert len(snippets) == 10
    for snippet in snippets:
        exec(compile(snippet, str(README), "exec"), names)
    assert "did you mean 'h'?" in capsys.readouterr().out


def test_the_first_lines_of_the_package(capsys):
    """The program in the package's own text."""
    lines = re.findall(r"^    (.*)$", msim.__doc__, re.M)
    exec("\n".join(lines), {})
    assert "success: True" in capsys.readouterr().out
