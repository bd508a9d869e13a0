"""Renders of many parts: statistics, checkpoints, goals, mattes, samples, jobs."""

import json
import subprocess

import fluxion
import numpy as np
import pytest

SIZE = (24, 18)


def test_every_statistic_is_a_keyword(scene_file):
    names = [name for name, _ in fluxion.statistics()]
    assert {"bins", "occlusion", "position", "ambient"} <= set(names)
    plain = fluxion.render(scene_file, size=SIZE, spp=8, method="primal", layers=True).frame
    for name in names:
        frame = fluxion.render(scene_file, size=SIZE, spp=8, method="primal", layers=True, **{name: True}).frame
        assert len(frame) > len(plain), name
    with pytest.raises(TypeError, match="nosuch"):
        fluxion.render(scene_file, nosuch=True)


def test_interrupted_renders_resume_to_the_same_bits(tmp_path, scene_file):
    file = tmp_path / "film.ckpt"
    render = lambda spp, **keywords: fluxion.render(scene_file, size=SIZE, spp=spp, method="frgr", **keywords).image
    render(4, checkpoint=file)
    with pytest.raises(ValueError, match="exists already"):
        render(8, checkpoint=file)
    assert np.array_equal(render(8, checkpoint=file, resume=True), render(8))
    with pytest.raises(fluxion.FluxionError, match="--seed"):
        render(8, checkpoint=file, resume=True, seed=1)


def test_mattes_samples_and_goals_are_those_of_the_program(tmp_path, program, scene_file):
    common = [program, "render", scene_file, "--size", "24x18", "--spp", "8", "--method", "primal", "-q"]
    theirs, mine = tmp_path / "theirs", tmp_path / "mine"
    theirs.mkdir(), mine.mkdir()
    mattes = ["--cryptomatte", theirs / "mattes.exr", "--samples", theirs / "samples"]
    subprocess.run([*common, "-o", theirs / "image.exr", *mattes], check=True)
    keywords = dict(size=SIZE, spp=8, method="primal")
    fluxion.render(scene_file, cryptomatte=mine / "mattes.exr", samples=mine / "samples", **keywords)
    assert (mine / "mattes.exr").exists()
    array = lambda folder: np.load(folder / "samples" / "color.npy")
    assert np.array_equal(array(theirs), array(mine))
    described = [json.loads((folder / "samples" / "samples.json").read_text()) for folder in (theirs, mine)]
    assert described[0] == described[1]
    goals = fluxion.render(scene_file, goals=theirs / "image.exr", size=SIZE, method="primal")
    assert goals.spp == 8


def test_jobs_make_the_image_of_one_render(tmp_path, program, scene_file):
    keywords = dict(spp=32, method="l2")
    job = fluxion.Job.plan([scene_file], tmp_path / "job", chunks=3, size=SIZE, **keywords)
    assert job.images == ["cornell-box"] and job.chunks == 3
    assert job.status() == dict(chunks=3, complete=0, started=[], missing=[0, 1, 2], waiting=[], wrong=[])
    assert all(job.run(chunk) for chunk in (0, 2))
    with pytest.raises(ValueError, match="chunks 1 of cornell-box"):
        job.merge()
    # The program goes on with what the module has begun.
    subprocess.run([program, "job", "run", "-q", tmp_path / "job", "1"], check=True)
    (image,) = fluxion.Job.load(tmp_path / "job").merge()
    whole = fluxion.render(scene_file, size=SIZE, **keywords).image
    assert np.allclose(fluxion.read_image(image), whole, rtol=1e-3, atol=1e-4)
    with pytest.raises(ValueError, match="has a job already"):
        fluxion.Job.plan([scene_file], tmp_path / "job", size=SIZE, **keywords)


def test_adaptive_jobs_have_two_rounds(tmp_path, scene_file):
    job = fluxion.Job.plan([scene_file], tmp_path / "job", chunks=4, adaptive="variance", size=SIZE, spp=64, method="l2")
    waiting = job.status()["waiting"]
    assert waiting and all(job.run(chunk) for chunk in range(job.chunks - len(waiting)))
    least, most = job.allocate()["cornell-box"]
    assert 8 <= least < most
    job = fluxion.Job.load(tmp_path / "job")
    assert all(job.run(chunk) for chunk in waiting) and job.status()["complete"] == job.chunks
    assert job.merge(image=False)[0].name == "cornell-box.ckpt"
