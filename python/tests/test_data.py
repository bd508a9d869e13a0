"""Data sets that the program has written, and the type stubs."""

import ast
import shutil
import subprocess
from pathlib import Path

import fluxion
import numpy as np
import pytest


@pytest.fixture(scope="module", params=["npy", "oidn"])
def folder(request, tmp_path_factory, program, scene_file):
    folder = tmp_path_factory.mktemp(request.param)
    command = [program, "dataset", scene_file, "-o", folder, "--size", "20x16", "--spp", "2,4", "--reference", "16"]
    subprocess.run([*command, "--layout", request.param], check=True)
    return folder


def test_data_sets_are_opened(folder):
    frames = fluxion.data.open(folder)
    assert len(frames) == 1 and list(frames)[0].name == frames[0].name == frames[:1][0].name == "cornell-box"
    sample = frames[0]
    assert sample.spp == [2, 4]
    inputs = sample.inputs(spp=4)
    assert all(inputs[name].shape == (16, 20, 3) for name in ("color", "albedo", "normal"))
    target = sample.target()
    assert target.shape == (16, 20, 3)
    # Four samples are nearer to the truth than two.
    error = lambda spp: fluxion.compare(sample.inputs(spp)["albedo"], sample.inputs(4)["albedo"], ["mse"])["mse"]
    assert error(2) > error(4) == 0
    with pytest.raises(ValueError, match="no 8 samples"):
        sample.inputs(spp=8)


def test_channels_have_their_names(folder):
    sample = fluxion.data.open(folder)[0]
    if sample.manifest["recipe"]["layout"] == "oidn":
        with pytest.raises(ValueError, match="layout oidn"):
            sample.array(2)
        return
    assert sample.array(2).shape == (16, 20, len(sample.channels))
    at = sample.channels.index("depth.Z")
    assert np.array_equal(sample.inputs(2)["depth"][..., 0], sample.array(2)[..., at])
    assert np.abs(sample.difference()).max() > 0


def test_arrays_of_other_channels_than_named_are_refused(folder, tmp_path):
    sample = fluxion.data.open(folder)[0]
    if sample.manifest["recipe"]["layout"] == "oidn":
        return
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    [path] = tmp_path.glob("*_0002spp.npy")
    np.save(path, np.load(path)[..., 1:])
    with pytest.raises(ValueError, match="render the frame again"):
        fluxion.data.open(tmp_path)[0].inputs(spp=2)


def test_a_folder_must_be_there(tmp_path):
    with pytest.raises(FileNotFoundError):
        fluxion.data.open(tmp_path / "nosuch")


def test_stubs_name_everything():
    tree = ast.parse((Path(fluxion.__file__).parent / "__init__.pyi").read_text())
    stubs = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert set(fluxion.__all__) - {"data", "__version__"} == set(stubs)
    for name, node in stubs.items():
        if isinstance(node, ast.ClassDef) and name != "FluxionError":
            public = {key for key in vars(getattr(fluxion, name)) if not key.startswith("_")}
            assert public == {item.name for item in node.body if getattr(item, "name", "_")[0] != "_"}, name
        assert getattr(fluxion, name).__doc__, name
