"""Renders: the bits of the program's, limits, interruption, errors."""

import os
import resource
import signal
import subprocess
import time

import fluxion
import numpy as np
import pytest

SIZE = (48, 40)


@pytest.mark.parametrize(
    "options, keywords",
    [
        (["--spp", "8"], {"spp": 8}),
        (["--spp", "4", "--seed", "3", "--method", "primal"], {"spp": 4, "seed": 3, "method": "primal"}),
        (["--spp", "12", "--adaptive"], {"spp": 12, "adaptive": "predicted_error"}),
        (
            ["--spp", "8", "--kernel", "structure", "--method", "l1"],
            {"spp": 8, "kernel": "structure", "method": "l1"},
        ),
    ],
)
def test_bits_are_the_programs(tmp_path, program, scene_file, options, keywords):
    image, layers = tmp_path / "image.exr", tmp_path / "layers.exr"
    command = [program, "render", scene_file, "-q", "--size", "48x40", "-o", image, "--layers", layers]
    subprocess.run([*command, *options], check=True)
    rendering = fluxion.render(scene_file, size=SIZE, layers=True, threads=1, **keywords)
    assert np.array_equal(rendering.image, fluxion.read_image(image))
    frame = fluxion.Frame.load(layers)
    assert sorted(frame.keys()) == sorted(rendering.frame.keys())
    assert all(np.array_equal(frame[key], rendering.frame[key]) for key in frame)
    same = ("version", "scene", "fingerprint", "seed", "spp", "plan")
    assert all(frame.provenance[key] == rendering.frame.provenance[key] for key in same)


def test_reconstruction_of_a_frame_is_that_of_its_render(scene_file):
    scene = fluxion.load_file(scene_file, size=SIZE)
    rendering = fluxion.render(scene, spp=8, method="frgr", layers=True)
    again = fluxion.reconstruct(rendering.frame, "frgr", notes=True)
    assert np.array_equal(rendering.image, again.image)
    assert again.notes and again.error.shape == again.image.shape == (40, 48, 3)
    assert rendering.spp == 8 and rendering.seconds > 0 and "gradients" in rendering.plan


def test_limits_and_progress(scene_file):
    seen = []
    scene = fluxion.load_file(scene_file, size=(160, 120))
    rendering = fluxion.render(scene, time=1.0, progress=lambda stage, share: seen.append((stage, share)))
    assert rendering.spp >= 1 and any(stage == "rendering" and 0 <= share <= 1 for stage, share in seen)
    assert fluxion.render(scene, target_error=0.5, spp=64, size=(32, 24)).spp <= 64


def interrupted(work):
    """Seconds that work goes on for after Ctrl-C."""
    # Shells have background jobs ignore it.
    heard = signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    previous = signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), signal.SIGINT))
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
        return time.monotonic()
    finally:
        signal.signal(signal.SIGALRM, previous)
        signal.signal(signal.SIGINT, heard)


def test_ctrl_c_ends_a_render_that_would_take_hours(scene_file):
    start = time.monotonic()
    end = interrupted(lambda: fluxion.render(scene_file, spp=1_000_000))
    assert end - start < 30
    # The module works on.
    assert fluxion.render(scene_file, size=(16, 16), spp=1).spp == 1


def test_exceptions_of_progress_reach_the_caller(scene_file):
    def stop(*_):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        fluxion.render(scene_file, spp=1_000_000, progress=stop)


def test_memory_does_not_grow(scene_file):
    scene = fluxion.load_file(scene_file, size=(32, 32))

    def peak(renders):
        for _ in range(renders):
            rendering = fluxion.render(scene, spp=1, method="frgr", layers=True)
            assert rendering.frame["albedo"].base is not None
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = peak(40)
    assert peak(160) - before < 6 * 1024, "kilobytes for 160 renders whose frames have some 150 each"


@pytest.mark.parametrize(
    "work, error, text",
    [
        (lambda _: fluxion.load_file("no/such.xml"), OSError, "no/such.xml"),
        (lambda file: fluxion.render(file, method="nosuch"), ValueError, "method `nosuch` is not known; there are"),
        (lambda file: fluxion.render(file, spp=0), ValueError, "from 1 on"),
        (lambda file: fluxion.render(file, spp=1, time=1.0), ValueError, "either"),
        (lambda file: fluxion.render(file, time=-1.0), ValueError, "positive"),
        (lambda file: fluxion.render(file, kernel="structure", method="frgr"), ValueError, "direct neighbours"),
        (lambda file: fluxion.render(file, adaptive="nosuch"), ValueError, "allocator `nosuch`"),
        (lambda file: fluxion.load_file(file, sensor="nosuch"), ValueError, "no sensor `nosuch`"),
        (lambda file: fluxion.render(file, spp=1, threads=10**6), ValueError, "up to 1024"),
        (lambda file: fluxion.load_file(file, size=(0, 9)), fluxion.FluxionError, "a film of 0x9 pixels"),
        (lambda file: fluxion.load_file(file, nosuch=1), ValueError, "no parameter `nosuch`"),
        (lambda file: fluxion.load_file(file, light_groups="key=nosuch*"), ValueError, "fits no emitter"),
    ],
)
def test_errors_are_exceptions_with_the_programs_text(scene_file, work, error, text):
    with pytest.raises(error, match=text):
        work(scene_file)


def test_faults_of_scene_files_name_the_line(tmp_path):
    path = tmp_path / "bad.xml"
    path.write_text('<scene version="3.0.0">\n<shape type="nosuch"/>\n</scene>')
    with pytest.raises(fluxion.FluxionError, match="bad.xml:2: .*nosuch"):
        fluxion.load_file(path)


def test_parameters_and_warnings(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.0.0"><default name="grey" value="0.5"/>'
        '<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="8"/>'
        '<integer name="height" value="6"/></film></sensor>'
        '<emitter type="constant"><rgb name="radiance" value="$grey"/></emitter></scene>'
    )
    image = lambda scene: fluxion.render(scene, spp=1, method="primal").image
    assert np.allclose(image(fluxion.load_file(path)), 0.5)
    assert np.allclose(image(fluxion.load_file(path, grey=0.25)), 0.25)
    path.write_text(path.read_text().replace("<emitter", '<integrator type="bdpt"/><emitter'))
    with pytest.warns(UserWarning, match="scene.xml:1: .*bdpt"):
        assert fluxion.load_file(path).warnings


def test_light_groups_add_up(scene_file):
    scene = fluxion.load_file(scene_file, size=SIZE, light_groups="all")
    rendering = fluxion.render(scene, spp=4)
    assert list(rendering.lights) == ["all"] and np.allclose(rendering.lights["all"], rendering.image, rtol=1e-5)
    assert np.array_equal(rendering.image, fluxion.render(scene_file, size=SIZE, spp=4).image)
