"""Scenes of one plugin each, beside Mitsuba 3: the ratio of the means of both, as docs/design/agreement.md says.

    python tools/plugins.py [SPP=1024] [NAME ...]

Run from the repository's top folder after `cargo build --release`; needs PyPI numpy, openimageio and mitsuba. FLUXION names
another program than target/release/fluxion.
"""
import os
import subprocess
import sys
import tempfile

import numpy as np

import exr

FLUXION = os.environ.get("FLUXION", "target/release/fluxion")

ROOM = """<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="6"/></integrator>
<sensor type="perspective"><float name="fov" value="45"/>
<transform name="to_world"><lookat origin="0.6,2.2,5" target="0,0.4,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="36"/><rfilter type="box"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="5"/><rotate x="1" angle="-90"/></transform></shape>
%s</scene>"""
LAMP = """<shape type="rectangle"><transform name="to_world"><scale value="0.7"/><rotate x="1" angle="90"/>
<translate x="1" y="3" z="1"/></transform><emitter type="area"><rgb name="radiance" value="9,7,5"/></emitter></shape>
<emitter type="constant"><rgb name="radiance" value="0.2,0.3,0.4"/></emitter>"""
BALL = '<shape type="sphere"><transform name="to_world"><translate y="1"/></transform>%s</shape>'
SUN = '<emitter type="sunsky">%s<transform name="to_world"><rotate x="1" angle="-90"/></transform></emitter>' + BALL % ""


def material(text):
    return ROOM % (LAMP + BALL % text)


SCENES = {
    "pplastic": material('<bsdf type="pplastic"><float name="alpha" value="0.2"/></bsdf>'),
    "pplastic, ggx": material('<bsdf type="pplastic"><string name="distribution" value="ggx"/><float name="alpha" value="0.4"/>'
                              '<rgb name="diffuse_reflectance" value="0.7,0.3,0.1"/></bsdf>'),
    "polarizer": material('<bsdf type="polarizer"/>'),
    "circular": material('<bsdf type="circular"><float name="transmittance" value="0.8"/></bsdf>'),
    "retarder": material('<bsdf type="retarder"><float name="transmittance" value="0.6"/></bsdf>'),
    "d65": ROOM % ('<emitter type="constant"><spectrum type="d65" name="radiance"><float name="scale" value="0.5"/>'
                   '</spectrum></emitter>' + BALL % ""),
    "projector": ROOM % ('<emitter type="projector"><float name="fov" value="50"/><spectrum type="d65" name="irradiance"><float '
                         'name="scale" value="3"/></spectrum><transform name="to_world"><lookat origin="2,3,2" target="0,0.5,0"'
                         ' up="0,1,0"/></transform></emitter>' + BALL % ""),
    "projector, picture": ROOM % ('<emitter type="projector"><float name="scale" value="2"/><texture type="bitmap" '
                                  'name="irradiance"><string name="filename" value="ASSETS/tiles.png"/></texture><transform '
                                  'name="to_world"><lookat origin="2,3,2" target="0,0.5,0" up="0,1,0"/></transform></emitter>'
                                  + BALL % ""),
    "sunsky": ROOM % (SUN % ""),
    "sunsky, sky": ROOM % (SUN % '<float name="sun_scale" value="0"/><float name="turbidity" value="4.5"/>'),
    "sunsky, low": ROOM % (SUN % '<vector name="sun_direction" value="1,0.25,0.3"/><float name="turbidity" value="6"/>'
                           '<rgb name="albedo" value="0.6,0.4,0.2"/>'),
    "sunsky, sun": ROOM % (SUN % '<float name="sky_scale" value="0"/><float name="sun_aperture" value="6"/>'),
    "lamp without bsdf": ROOM % ('<shape type="sphere"><transform name="to_world"><translate y="1"/></transform><emitter '
                                 'type="area"/></shape>'),
}


def fluxion(path, spp, out):
    subprocess.run([FLUXION, "render", path, "-o", out, "--spp", str(spp), "--method", "primal", "-q"], check=True)
    return exr.rgb(out)


def main():
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    arguments = sys.argv[1:]
    spp = int(arguments.pop(0)) if arguments and arguments[0].isdigit() else 1024
    print("| scene | R | G | B |\n|---|---|---|---|")
    for name, text in SCENES.items():
        if arguments and not any(part in name for part in arguments):
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "scene.xml")
            with open(path, "w") as file:
                file.write(text.replace("ASSETS", os.path.abspath("scenes/assets")))
            ours = fluxion(path, spp, os.path.join(folder, "a.exr"))
            theirs = np.array(mi.render(mi.load_file(path), spp=spp, seed=1), dtype=np.float64)
        ratio = ours.mean((0, 1)) / theirs.mean((0, 1))
        print("| %s | %s |" % (name, " | ".join("%.4f" % r for r in ratio)), flush=True)


if __name__ == "__main__":
    main()
