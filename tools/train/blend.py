"""The network of the method `blend`: convex weights of finished images, pixel by pixel.

    python tools/train/blend.py train FRAMES... --run runs/blend
    python tools/train/blend.py test FRAMES... --run runs/blend
    python tools/train/blend.py export FRAMES... --run runs/blend

FRAMES are folders of `fluxion dataset` with the images that are mixed; ten of every hundred scenes are kept apart for tests.
Training goes on where it was interrupted, and logs to log.csv. `export` writes src/reconstruct/blend/oidn.safetensors if the gate
holds: on the scenes kept apart less error than the best single image at every sample count. Features and safety rule are those
of src/reconstruct/blend/.
"""
import json
import os

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn

import frames
import net
import residual
import runs
from frames import planes

# Images that are mixed; the last, the sampled colours, takes what the safety rule leaves.
CANDIDATES = ["frgr_denoiser_oidn_level0_enhanced", "frgr_denoiser_oidn_denoised", "net_image_safe", "frgr", ""]
# The one whose own error is estimated.
BEST = CANDIDATES.index("net_image_safe")
WIDTH, SLOPE = 24, 0.01
# Radius of the window that residuals are averaged over, by themselves.
RESIDUAL = 3
CROP, BATCH, RATE, STEPS = 64, 8, 2e-3, 4000
EPSILON = 0.03
# Errors that are good enough.
FLOOR = 2e-4


def weigher():
    candidates = len(CANDIDATES)
    inputs = 4 * candidates + 5
    layers = [nn.Conv2d(inputs, WIDTH, 3, padding=1), nn.LeakyReLU(SLOPE),
              nn.Conv2d(WIDTH, WIDTH, 3, padding=2, dilation=2), nn.LeakyReLU(SLOPE),
              nn.Conv2d(WIDTH, WIDTH, 3, padding=1), nn.LeakyReLU(SLOPE), nn.Conv2d(WIDTH, candidates, 1)]
    nn.init.zeros_(layers[-1].weight)
    nn.init.zeros_(layers[-1].bias)
    # The colours start with a small weight.
    with torch.no_grad():
        layers[-1].bias[-1] = -4
    return nn.Sequential(*layers)


def prepare(frame):
    """Images (candidates, 3, height, width), features, trust of each image and target."""
    colour, variance = planes(frame.radiance("")), net.variance_of(frame)
    images = torch.stack([planes(frame.image(name)) for name in CANDIDATES])
    luminance = images.mean(1)
    noise = residual.box(variance, residual.RADIUS).clamp(min=residual.LEAST_NOISE)
    middle = luminance.mean(0, keepdim=True).clamp(min=0)
    unit = middle + 0.1
    apart = residual.box(colour.mean(0, keepdim=True) - luminance, RESIDUAL)
    deviation = (residual.box(variance, RESIDUAL) / (2 * RESIDUAL + 1) ** 2 + 1e-9).sqrt()
    bias = torch.cat([residual.squared_error(colour, variance, image) for image in images])
    claimed = residual.estimated_error(colour, variance, images[BEST])
    features = torch.cat([
        torch.asinh(3 * (luminance - middle) / unit), torch.asinh(3 * apart / unit), torch.asinh(apart / deviation),
        torch.asinh(bias / noise),
        0.5 * torch.log(variance + 1e-7) - torch.log(unit), torch.log(unit), 0.5 * torch.log(claimed + 1e-7) - torch.log(unit),
        planes(frame.get("albedo", "RGB")).mean(0, keepdim=True), torch.full_like(unit, frame.told_samples())])
    trust = residual.trust(noise, bias, frame.spp)
    trust[-1] = 1
    frame.array = None
    return {"images": images, "features": features, "trust": trust, "target": planes(frame.target),
            "spp": frame.spp, "name": frame.name, "frame": frame}


def weights(logits, trust):
    """Convex weights: what images lose by the safety rule goes to the last one."""
    kept = torch.softmax(logits, -3) * trust
    return torch.cat([kept[..., :-1, :, :], 1 - kept[..., :-1, :, :].sum(-3, keepdim=True)], -3)


def blended(weigh, sample):
    """The image, channels first, of a sample or a batch."""
    batched = sample["features"].dim() == 4
    features = sample["features"] if batched else sample["features"][None]
    made = weigh(features)
    kept = weights(made if batched else made[0], sample["trust"])
    return (kept.unsqueeze(-3) * sample["images"]).sum(-4)


def samples(folders):
    """Training samples and those of the scenes kept apart."""
    everything = frames.load(folders)
    last = {frame.name: frame for frame in everything}
    made = []
    clean = {name: frame.image("frgr").mean(-1) / frame.scale for name, frame in last.items()}
    for frame in everything:
        sample = prepare(frame)
        # What errors are divided by comes from other samples than the target's: noise in it would darken the image.
        sample["divisor"] = torch.from_numpy(clean[frame.name] * frame.scale)[None] ** 2 + EPSILON
        made.append(sample)
    return [s for s in made if not runs.is_apart(s["name"])], [s for s in made if runs.is_apart(s["name"])]


def crops(data, rng):
    """A batch of random crops, turned and mirrored at random."""
    batch = {key: [] for key in ("images", "features", "trust", "target", "divisor")}
    for _ in range(BATCH):
        sample = data[rng.integers(len(data))]
        height, width = sample["target"].shape[-2:]
        y, x = rng.integers(height - CROP + 1), rng.integers(width - CROP + 1)
        turns, mirrored = int(rng.integers(4)), rng.random() < 0.5
        for key, parts in batch.items():
            part = torch.rot90(sample[key][..., y:y + CROP, x:x + CROP], turns, (-2, -1))
            parts.append(part.flip(-1) if mirrored else part)
    return {key: torch.stack(parts) for key, parts in batch.items()}


def loss(weigh, batch):
    """Geometric mean of the relMSE of crops over that of the best candidate: no crop owns the gradient."""
    error = lambda image: ((image - batch["target"]) ** 2 / batch["divisor"]).mean((-3, -2, -1)) + FLOOR
    best = torch.stack([error(batch["images"][:, k]) for k in range(batch["images"].shape[1])]).amin(0)
    return (error(blended(weigh, batch)) / best).log().mean()


def train(options):
    training, apart = samples(options.frames)
    if not apart:
        raise SystemExit("none of these scenes is kept apart for tests: those are numbers 90 to 99 of every hundred")
    print(f"{len(training)} images to train on, {len(apart)} apart", flush=True)
    torch.manual_seed(options.seed)
    weigh = weigher()
    runs.descend(weigh, lambda rng: loss(weigh, crops(training, rng)), RATE, options)


def trained(options):
    return runs.trained(weigher(), options)


def compared(weigh, apart):
    """Errors on the scenes kept apart, the targets' noise taken off, as a table of means over the frames, each in units of frgr's. True if
    the blend has less than any single image at every sample count."""
    rows = {}
    for sample in apart:
        with torch.no_grad():
            kept = weights(weigh(sample["features"][None])[0], sample["trust"])
            image = (kept.unsqueeze(1) * sample["images"]).sum(0)
        frame, last = sample["frame"], lambda planes: np.moveaxis(planes.numpy(), 0, -1)
        errors = [frame.rel_mse(last(image)) for image in (*sample["images"], image)]
        rows.setdefault(sample["spp"], []).append(frame.comparable(errors, errors[CANDIDATES.index("frgr")]))
    others = [name or "colours" for name in CANDIDATES]
    return frames.holds(rows, [*others, "blend"], "blend", others)


def test(options):
    compared(trained(options)[0], samples(options.frames)[1])


def export(options):
    """Writes half floats, and for the tests what the network makes of them on one crop."""
    (weigh, steps), (training, apart) = trained(options), samples(options.frames)
    if not compared(weigh, apart):
        raise SystemExit("not exported: a single image is better")
    weigh = weigh.half().float()
    top = os.path.join(os.path.dirname(__file__), "..", "..")
    named = {f"layer{k}.{key}": value.half() for k, layer in enumerate(layer for layer in weigh if hasattr(layer, "weight"))
             for key, value in layer.state_dict().items()}
    recipe = {"candidates": CANDIDATES, "images": len(training), "steps": steps, "batch": BATCH, "crop": CROP,
              "rate": RATE, "seed": options.seed}
    save_file(named, os.path.join(top, "src/reconstruct/blend/oidn.safetensors"),
              {"recipe": json.dumps(recipe)})
    given = apart[0]["features"][None, :, :12, :15]
    with torch.no_grad():
        made = torch.softmax(weigh(given), 1)
    vectors = {name: planes[0].permute(1, 2, 0).contiguous() for name, planes in (("input", given), ("output", made))}
    save_file(vectors, os.path.join(top, "tests/data", "blend-oidn.safetensors"))


if __name__ == "__main__":
    runs.command(__doc__, STEPS, train=train, test=test, export=export)
