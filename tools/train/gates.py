"""Gate of learned methods: their errors beside what they are made of, from the same samples, on scenes that they were not trained on.

    python tools/train/gates.py --scenes FOLDER [--work measured] [--spp 4,16,64] [--seeds 3]

FOLDER holds public scenes as NAME/scene.xml; `--work` is the folder in which `tools/figures references` has made references of them. Prints the four
measures over those of frgr, and fails if one of them is above 1.1 of the best of these on a scene whose reference is good enough for it. Needs PyPI numpy,
openimageio and pyoidn, and `cargo build --release`.
"""
import argparse
import os
import sys

TOOLS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
sys.path[:0] = [TOOLS, os.path.join(TOOLS, "figures")]
import runner
import tables
from measures import samples

# Rivals of each learned method.
LEARNED = {"net": ["frgr"], "blend:oidn=on": ["frgr", "net", "oidn", "frgr:denoiser=oidn"]}
METHODS = ["frgr", "oidn", "frgr:denoiser=oidn", "net", "blend:oidn=on"]
LARGEST = 1.1


def failures(errors):
    """Learned methods that lose to a rival by a measure."""
    found = []
    for budget, scene, method in errors.of:
        for measure in tables.MEASURES:
            rivals = LEARNED.get(method)
            noisy = measure != "relmse" and not errors.clean(budget, scene)
            if not rivals or noisy or not errors.usable(budget, scene, [method, *rivals]):
                continue
            best = min(errors.of[budget, scene, rival][measure] for rival in rivals)
            ratio = errors.of[budget, scene, method][measure] / best
            if ratio > LARGEST:
                found.append("%s on %s with %s: %.2f in %s" % (method, scene, budget, ratio, tables.MEASURES[measure]))
    return found


def main(options):
    where = runner.context(options.scenes, options.work)
    variants = [{"label": "", "options": ["--method", "l2"]}]
    run = {"spp": [int(spp) for spp in options.spp.split(",")], "seeds": options.seeds, "methods": METHODS, "variants": variants}
    _, runs, _ = runner.measured("gates", samples, run, where, [scene.name for scene in where.scenes], {})
    print(tables.table({"form": "ratios", "baseline": "frgr"}, runs))
    found = failures(tables.Errors(runs, lambda run: run["method"]))
    if found:
        sys.exit("\n".join(found))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", required=True)
    parser.add_argument("--work", default="measured")
    parser.add_argument("--spp", default="4,16,64")
    parser.add_argument("--seeds", type=int, default=3)
    main(parser.parse_args())
