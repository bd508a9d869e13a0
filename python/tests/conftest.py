"""Where the repository's scenes are, and the program that the module must agree with."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def scene_file():
    return ROOT / "scenes" / "cornell-box" / "scene.xml"


@pytest.fixture(scope="session")
def program():
    """The program `fluxion`, by the variable FLUXION."""
    path = Path(os.environ.get("FLUXION", ROOT / "target" / "release" / "fluxion"))
    if not path.exists():
        pytest.fail(f"there is no program at {path}: build it, or name another by the variable FLUXION")
    return path
