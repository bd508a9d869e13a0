"""Frames: arrays over their memory, made of arrays, as files."""

import fluxion
import numpy as np
import pytest

RANDOM = np.random.default_rng(1)


@pytest.fixture(scope="module")
def frame(scene_file):
    return fluxion.render(scene_file, size=(24, 20), spp=8, method="frgr", layers=True).frame


def test_layers_share_the_frames_memory(frame):
    first, second = frame["albedo"], frame["albedo"]
    assert first.shape == (20, 24, 3) and first.dtype == np.float32 and first.flags.c_contiguous
    assert np.shares_memory(first, second) and not np.shares_memory(first, frame["normal"])
    assert memoryview(first).format == "f" and memoryview(first).readonly
    with pytest.raises(ValueError):
        first[0, 0, 0] = 1.0
    values = first.copy()
    del frame, second
    assert np.array_equal(first, values)


def test_arrays_outlive_their_owner(scene_file):
    image = fluxion.render(scene_file, size=(16, 16), spp=1, method="primal").image
    values = image.copy()
    for seed in range(8):
        fluxion.render(scene_file, size=(16, 16), spp=1, method="primal", seed=seed)
    assert np.array_equal(image, values)


@pytest.mark.skipif(np.lib.NumpyVersion(np.__version__) < "2.1.0", reason="read-only arrays need DLPack 1.0")
def test_dlpack(frame):
    array = np.from_dlpack(frame["depth"])
    assert np.shares_memory(array, frame["depth"])


def test_a_frame_is_a_mapping(frame):
    assert len(frame) == len(frame.keys()) and "color" in frame and "nosuch" not in frame
    assert set(dict(frame)) == set(frame.keys())
    with pytest.raises(KeyError, match="albedo"):
        frame["nosuch"]


def test_files_keep_every_layer(frame, tmp_path):
    frame.save(tmp_path / "frame.exr")
    back = fluxion.Frame.load(tmp_path / "frame.exr")
    assert back.keys() == frame.keys() and back.provenance == frame.provenance
    assert all(np.array_equal(back[key], frame[key]) for key in frame)


def test_frames_of_arrays_are_filtered(frame):
    given = {key: frame[key] for key in ("albedo", "albedo_variance", "normal", "normal_variance", "color_variance")}
    made = fluxion.Frame.from_arrays(frame["color"], spp=8, **given)
    assert np.array_equal(made["albedo"], frame["albedo"]) and made["samples"][0, 0, 0] == 8
    image = fluxion.reconstruct(made, "nfor").image
    assert image.shape == (20, 24, 3) and np.isfinite(image).all()
    with pytest.raises(fluxion.FluxionError, match="dx"):
        fluxion.reconstruct(made, "frgr")


def test_renders_tell_their_variance():
    renders = RANDOM.uniform(0.5, 1.5, (8, 6, 5, 3)).astype(np.float32)
    frame = fluxion.Frame.from_renders(list(renders), spp=4, albedo=np.ones((6, 5, 3)))
    assert np.allclose(frame["color"], renders.mean(axis=0), rtol=1e-6)
    assert np.allclose(frame["color_variance"], renders.var(axis=0, ddof=1) / 8, rtol=1e-4)
    assert all(np.array_equal(frame[f"bin{k}"], renders[k]) for k in range(8))
    assert (frame["samples"] == 32).all() and (frame["albedo_variance"] == 0).all()
    three = fluxion.Frame.from_renders(list(renders[:3]), spp=1)
    assert np.allclose(three["bin0"], renders[[0, 2]].mean(axis=0)) and np.array_equal(three["bin1"], renders[1])


def test_filters_denoise_renders():
    truth = np.linspace(0.2, 1.0, 48 * 48 * 3).reshape(48, 48, 3)
    renders = [truth * RANDOM.gamma(4.0, 0.25, truth.shape) for _ in range(8)]
    flat = np.zeros((48, 48, 3))
    frame = fluxion.Frame.from_renders(renders, spp=4, albedo=flat, normal=flat)
    error = lambda image: fluxion.compare(image, truth, ["relmse"])["relmse"]
    assert error(fluxion.reconstruct(frame, "nfor").image) < 0.3 * error(frame["color"])


@pytest.mark.parametrize(
    "make, text",
    [
        (lambda: fluxion.Frame.from_arrays(np.zeros((4, 4))), "1 channels, not 3"),
        (lambda: fluxion.Frame.from_arrays(np.zeros((4, 4, 3, 1))), "4 dimensions"),
        (lambda: fluxion.Frame.from_arrays(np.zeros((0, 4, 3))), "no pixels"),
        (lambda: fluxion.Frame.from_arrays(np.zeros((4, 4, 3)), albedo=np.zeros((4, 5, 3))), "albedo is of 5x4"),
        (lambda: fluxion.Frame.from_arrays(np.zeros((4, 4, 3)), nosuch=np.zeros((4, 4))), "nosuch is no layer"),
        (lambda: fluxion.Frame.from_renders([np.zeros((4, 4, 3))], spp=1), "two or more"),
        (lambda: fluxion.compare(np.zeros((4, 4, 3)), np.zeros((4, 4, 3)), ["nosuch"]), "nosuch is no metric"),
    ],
)
def test_arrays_that_do_not_fit_are_errors(make, text):
    with pytest.raises(ValueError, match=text):
        make()


def test_values_that_make_no_sense_are_errors():
    color = np.ones((4, 4, 3))
    color[1, 2, 0] = np.nan
    with pytest.raises(fluxion.FluxionError, match="not finite at pixel 2,1"):
        fluxion.reconstruct(fluxion.Frame.from_arrays(color), "primal")
    with pytest.raises(fluxion.FluxionError, match="shape"):
        fluxion.compare(np.ones((4, 4, 3)), np.ones((4, 5, 3)))


@pytest.mark.parametrize("name, tolerance", [("a.exr", 0), ("a.pfm", 0), ("a.tiff", 0), ("a.hdr", 0.01), ("a.png", 0.01)])
def test_image_files(tmp_path, name, tolerance):
    image = RANDOM.uniform(0, 1, (7, 9, 3)).astype(np.float32)
    fluxion.write_image(tmp_path / name, image)
    assert np.abs(fluxion.read_image(tmp_path / name) - image).max() <= tolerance


def test_metrics_of_equal_images():
    image = RANDOM.uniform(0.1, 1, (200, 200, 3))
    found = fluxion.compare(image, image)
    assert set(found) == set(fluxion.metrics()) and found["relmse"] == 0 and found["ms_ssim"] == pytest.approx(1)
    assert {"frgr", "nfor", "net"} <= set(fluxion.methods())
