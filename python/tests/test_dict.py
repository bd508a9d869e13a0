"""Scenes as dictionaries: the same as those of scene files, and as Mitsuba's where that is installed."""

import numpy as np
import pytest

import fluxion

SQUARE = {
    "type": "mesh",
    "vertex_positions": np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]),
    "vertex_texcoords": np.array([[0, 0], [1, 0], [1, 1], [0, 1]]),
    "faces": np.array([[0, 1, 2], [0, 2, 3]]),
}


def look_at(origin, target, up=(0, 1, 0)):
    """A frame that looks along +z to its target, with +x to the left."""
    origin, target, up = (np.asarray(v, dtype=float) for v in (origin, target, up))
    forward = (target - origin) / np.linalg.norm(target - origin)
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = left, np.cross(forward, left), forward, origin
    return matrix


def sensor(**more):
    return {
        "type": "perspective",
        "fov": 40,
        "to_world": look_at((0, 0, 5), (0, 0, 0)),
        "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent", "sample_count": 16},
        **more,
    }


def room():
    checks = np.zeros((4, 4, 3), dtype=np.uint8)
    checks[::2, ::2] = checks[1::2, 1::2] = (200, 100, 50)
    turned = np.diag([0.5, 0.5, 0.5, 1.0])
    turned[:3, 3] = (0.2, -0.3, 0.5)
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "sensor": sensor(),
        "paint": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.3, 0.1]}},
        "ball": {"type": "sphere", "to_world": turned, "material": {"type": "ref", "id": "paint"}},
        "wall": {
            "type": "rectangle",
            "to_world": np.diag([3.0, 3.0, 1.0, 1.0]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "bitmap", "data": checks, "filter_type": "nearest"}},
        },
        "lamp": {
            "type": "rectangle",
            "to_world": look_at((1, 2, 3), (0, 0, 0)),
            "emitter": {"type": "area", "radiance": {"type": "spectrum", "value": 4.0}},
        },
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.2}},
    }


XML = """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
<shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="0.25 0.5 0.75"/></bsdf></shape>
<emitter type="constant"/></scene>"""


def image(scene, spp=4):
    return fluxion.render(scene, spp=spp, method="primal", seed=1).image


def test_dictionaries_and_strings_are_the_same_scene():
    reflectance = {"type": "rgb", "value": [0.25, 0.5, 0.75]}
    ball = {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    scene = {"type": "scene", "sensor": sensor(), "ball": ball, "sky": {"type": "constant"}}
    loaded = fluxion.load_dict(scene)
    assert (loaded.width, loaded.height, loaded.spp) == (16, 16, 16)
    assert np.array_equal(image(loaded), image(fluxion.load_string(XML)))
    assert fluxion.load_dict(scene, size=(8, 4)).width == 8
    assert fluxion.render(loaded, spp=1, size=(8, 8), method="primal").image.shape == (8, 8, 3)


def test_meshes_and_images_are_arrays():
    light = np.linspace(0.25, 1.0, 12, dtype=np.float32).reshape(2, 2, 3)
    lamp = {**SQUARE, "emitter": {"type": "area", "radiance": {"type": "bitmap", "data": light, "filter_type": "nearest"}}}
    close = sensor(to_world=look_at((0, 0, 2), (0, 0, 0)), fov=20)
    found = image(fluxion.load_dict({"type": "scene", "sensor": close, "lamp": lamp}))
    # Rows of images run from the top, texture coordinates from the top, too: the square's second row is above.
    assert np.allclose(found[0, 0], light[1, 0], rtol=1e-3) and np.allclose(found[-1, -1], light[0, 1], rtol=1e-3)
    encoded = (np.full((2, 2), 128, dtype=np.uint8), 0.2159)
    for pixels, raw, expected in [(*encoded[:1], False, encoded[1]), (*encoded[:1], True, 128 / 255)]:
        radiance = {"type": "bitmap", "data": pixels, "raw": raw}
        lamp = {**SQUARE, "emitter": {"type": "area", "radiance": radiance}}
        found = image(fluxion.load_dict({"type": "scene", "sensor": close, "lamp": lamp}))
        assert np.allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ball": {"type": "sfere"}}, 'scene["ball"]: shape `sfere` is not known'),
        ({"ball": {"type": "sphere", "radios": 2.0}}, 'scene["ball"]["radios"]: shape `sphere` has no property `radios`'),
        ({"ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": "red"}}}, 'scene["ball"]["bsdf"]["reflectance"]'),
        ({"ball": {"radius": 1.0}}, 'scene["ball"]: a dictionary needs its "type"'),
        ({"ball": {"type": "sphere", "to_world": np.zeros((4, 4))}}, 'scene["ball"]["to_world"]'),
        ({"ball": {"type": "sphere", "center": [0, np.nan, 0]}}, 'scene["ball"]["center"]: a number is not finite'),
        ({"ball": {"type": "sphere", "center": [0, 1]}}, 'scene["ball"]["center"]: an array of 2'),
        ({"ball": {"type": "sphere", "center": object()}}, 'scene["ball"]["center"]: object is no value'),
        ({"ball": {**SQUARE, "faces": np.array([[0, 1, 9]])}}, "a face names vertex 9 of 4"),
        ({"ball": {"type": "mesh", "faces": []}}, 'scene["ball"]: a mesh needs'),
        ({"ball": {"type": "ref", "id": "nobody"}}, 'scene["ball"]'),
    ],
)
def test_mistakes_are_named_by_their_keys(change, message):
    with pytest.raises(fluxion.FluxionError) as raised:
        fluxion.load_dict({"type": "scene", "sensor": sensor(), **change})
    assert message in str(raised.value)


def test_types_in_capitals_dollars_and_single_pairs_are_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fluxion.write_image("a$b.exr", np.full((2, 2, 3), 0.5, dtype=np.float32))
    radiance = {"type": "Bitmap", "filename": "a$b.exr"}
    lamp = {**SQUARE, "light": {"type": "area", "radiance": radiance}, "paint": {"type": "Diffuse"}}
    sky = {"type": "constant", "radiance": {"type": "spectrum", "value": [(550, 0.3)]}}
    close = sensor(to_world=look_at((0, 0, 2), (0, 0, 0)), fov=20)
    found = image(fluxion.load_dict({"type": "scene", "sensor": close, "lamp": lamp}), spp=1)
    assert np.allclose(found, 0.5, rtol=1e-2)
    fluxion.load_dict({"type": "scene", "sensor": close, "sky": sky})


def test_only_scenes_are_taken():
    with pytest.raises(fluxion.FluxionError, match="type"):
        fluxion.load_dict({"type": "sphere"})


def test_scenes_are_as_bright_as_mitsubas():
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    scene = room()
    scene["ball"]["to_world"] = mitsuba.ScalarTransform4f(scene["ball"]["to_world"])
    theirs = {**scene, "wall": {**scene["wall"]}}
    pixels = scene["wall"]["bsdf"]["reflectance"]["data"]
    reflectance = {"type": "bitmap", "bitmap": mitsuba.Bitmap(pixels), "filter_type": "nearest"}
    scene["wall"] = {**scene["wall"], "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    theirs["wall"] = scene["wall"]
    for key in ("sensor", "wall", "lamp"):
        theirs[key] = {**theirs[key], "to_world": mitsuba.ScalarTransform4f(theirs[key]["to_world"])}
    expected = np.array(mitsuba.render(mitsuba.load_dict(theirs), spp=1024))
    found = image(fluxion.load_dict(scene), spp=1024)
    assert np.allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.01)
    assert np.median(np.abs(found - expected) / expected.mean()) < 0.03
