"""The examples of the guide that say that they run."""

import re

import pytest

from conftest import ROOT

GUIDE = (ROOT / "docs" / "guide" / "python.md").read_text()
EXAMPLES = re.findall(r"<!-- runs -->\n\n```python\n(.*?)```", GUIDE, re.DOTALL)


def test_the_guide_has_examples():
    assert EXAMPLES


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_an_example_runs_and_writes_its_images(example, tmp_path, monkeypatch):
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "docs/guide/python.md", "exec"), {})
    for name in re.findall(r'write_image\("([^"]+)"', example):
        assert (tmp_path / name).stat().st_size > 0
