"""The network of the method `blend`: convex weights of finished images, pixel by pixel.

    python tools/train/blend.py train own FRAMES... --run runs/blend-own
    python tools/train/blend.py test own FRAMES... --run runs/blend-own
    python tools/train/blend.py export own FRAMES... --run runs/blend-own

`own` mixes Fluxion's own images, `oidn` also those of Open Image Denoise. FRAMES are folders of `fluxion dataset`; ten of every
hundred scenes are kept apart for tests. Training goes on where it was interrupted, and logs to log.csv. `export`
writes src/reconstruct/blend/NAME.safetensors if the gates hold: on the scenes kept apart less error than the best single
image at every sample count. Features and safety rule are those of src/reconstruct/blend/.
"""
import argparse
import csv
import json
import os
import time

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn import functional as F

import frames

# Images; the last, the sampled colours, takes what the safety rule leaves.
CANDIDATES = {"own": ["frgr", "frgr_denoised", "frgr_level0_enhanced", ""],
              "oidn": ["frgr_denoiser_oidn", "frgr_denoiser_oidn_denoised", "frgr_denoiser_oidn_level0_enhanced", "frgr", ""]}
WIDTH, SLOPE = 24, 0.01
# Squared residuals beyond the noise may be this share of it before an image counts as biased; more where few samples, fewer
# than this number, say little about the noise.
TRUST, FEW = 0.5, 16
RESIDUAL, BIAS = 3, 7
CROP, BATCH, RATE, STEPS = 64, 8, 2e-3, 4000
EPSILON = 0.03
# Errors that are good enough.
FLOOR = 2e-4


def network(candidates):
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


def box(image, radius):
    """Means over windows, mirrored beyond the border without repeating it."""
    padded = F.pad(image[None], (radius,) * 4, mode="reflect")
    return F.avg_pool2d(padded, 2 * radius + 1, 1)[0]


def prepare(frame, names):
    """Images (candidates, 3, height, width), features, trust of each image, target and what its errors are divided by."""
    planes = lambda array: torch.from_numpy(np.ascontiguousarray(np.moveaxis(array, -1, 0)))
    colour, sigma = planes(frame.radiance("")), planes(frame.radiance("sigma"))
    images = torch.stack([planes(frame.image(name)) for name in names])
    luminance, variance = images.mean(1), (sigma ** 2).mean(0, keepdim=True)
    noise = box(variance, BIAS).clamp(min=1e-9)
    middle = luminance.mean(0, keepdim=True).clamp(min=0)
    unit = middle + 0.1
    residual = box(colour.mean(0, keepdim=True) - luminance, RESIDUAL)
    deviation = (box(variance, RESIDUAL) / (2 * RESIDUAL + 1) ** 2 + 1e-9).sqrt()
    bias = box(((images - colour) ** 2).mean(1) - variance, BIAS)
    claimed = planes(frame.radiance("frgr_sigma")) ** 2 - planes(frame.radiance("direct_sigma")) ** 2
    claimed = claimed.clamp(min=0).mean(0, keepdim=True)
    features = torch.cat([
        torch.asinh(3 * (luminance - middle) / unit), torch.asinh(3 * residual / unit), torch.asinh(residual / deviation),
        torch.asinh(bias / noise),
        0.5 * torch.log(variance + 1e-7) - torch.log(unit), torch.log(unit), 0.5 * torch.log(claimed + 1e-7) - torch.log(unit),
        planes(frame.get("albedo", "RGB")).mean(0, keepdim=True), torch.full_like(unit, np.log2(frame.spp) / 4)])
    trust = (TRUST * (1 + FEW / frame.spp) * noise / bias.clamp(min=1e-12)).clamp(max=1)
    trust[-1] = 1
    frame.array = None
    return {"images": images, "features": features, "trust": trust, "target": planes(frame.target), "noise": noise,
            "bias": bias, "variance": variance, "spp": frame.spp, "name": frame.name, "frame": frame}


def weights(logits, trust):
    """Convex weights: what images lose by the safety rule goes to the last one."""
    kept = torch.softmax(logits, -3) * trust
    return torch.cat([kept[..., :-1, :, :], 1 - kept[..., :-1, :, :].sum(-3, keepdim=True)], -3)


def blended(net, sample):
    """The image, channels first, of a sample or a batch."""
    batched = sample["features"].dim() == 4
    features = sample["features"] if batched else sample["features"][None]
    made = net(features)
    kept = weights(made if batched else made[0], sample["trust"])
    return (kept.unsqueeze(-3) * sample["images"]).sum(-4)


def samples(folders, kind):
    """Training samples and those of the scenes kept apart."""
    everything = frames.load(folders)
    last = {frame.name: frame for frame in everything}
    made = []
    clean = {name: frame.image("frgr").mean(-1) / frame.scale for name, frame in last.items()}
    for frame in everything:
        sample = prepare(frame, CANDIDATES[kind])
        # What errors are divided by comes from other samples than the target's: noise in it would darken the image.
        sample["divisor"] = torch.from_numpy(clean[frame.name] * frame.scale)[None] ** 2 + EPSILON
        made.append(sample)
    # Ten scenes of every hundred.
    apart = lambda sample: int(sample["name"]) // 10 % 10 == 9
    return [s for s in made if not apart(s)], [s for s in made if apart(s)]


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


def loss(net, batch):
    """Geometric mean of the relMSE of crops over that of the best candidate: no crop owns the gradient."""
    error = lambda image: ((image - batch["target"]) ** 2 / batch["divisor"]).mean((-3, -2, -1)) + FLOOR
    best = torch.stack([error(batch["images"][:, k]) for k in range(batch["images"].shape[1])]).amin(0)
    return (error(blended(net, batch)) / best).log().mean()


def train(options):
    torch.set_num_threads(options.threads)
    os.makedirs(options.run, exist_ok=True)
    training, apart = samples(options.frames, options.kind)
    if not apart:
        raise SystemExit("none of these scenes is kept apart for tests: those are numbers 90 to 99 of every hundred")
    net = network(len(CANDIDATES[options.kind]))
    optimiser = torch.optim.Adam(net.parameters(), RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, options.steps)
    state_path, step = os.path.join(options.run, "state.pt"), 0
    if os.path.exists(state_path):
        state = torch.load(state_path)
        net.load_state_dict(state["net"])
        optimiser.load_state_dict(state["optimiser"])
        schedule.load_state_dict(state["schedule"])
        step = state["step"]
    print(f"{len(training)} images to train on, {len(apart)} apart; from step {step}", flush=True)
    with open(os.path.join(options.run, "log.csv"), "a", newline="") as file:
        log, saved, mean = csv.writer(file), time.time(), 0.0
        while step < options.steps:
            # A step draws the same crops whenever it is taken.
            rng = np.random.default_rng([options.seed, step])
            value = loss(net, crops(training, rng))
            optimiser.zero_grad()
            value.backward()
            optimiser.step()
            schedule.step()
            step += 1
            mean += 0.01 * (float(value.detach()) - mean)
            if step % 200 == 0:
                log.writerow([step, "%.5f" % mean])
                file.flush()
                print(step, "%.4f" % mean, flush=True)
            if time.time() - saved > 60 or step == options.steps:
                state = {"net": net.state_dict(), "optimiser": optimiser.state_dict(), "schedule": schedule.state_dict(),
                         "step": step}
                torch.save(state, state_path + ".part")
                os.replace(state_path + ".part", state_path)
                saved = time.time()


def trained(options):
    net = network(len(CANDIDATES[options.kind]))
    state = torch.load(os.path.join(options.run, "state.pt"))
    net.load_state_dict(state["net"])
    return net, state["step"]


def compared(net, names, apart):
    """Errors on the scenes kept apart, as a table: geometric means over those of the best single image. True if all are less."""
    rows, calibration = {}, []
    for sample in apart:
        with torch.no_grad():
            kept = weights(net(sample["features"][None])[0], sample["trust"])
            image = (kept.unsqueeze(1) * sample["images"]).sum(0)
            claimed = (kept[:-1] * torch.maximum(sample["bias"][:-1], 0.02 * sample["noise"])).sum(0)
            claimed += kept[-1] * sample["variance"][0]
        frame, last = sample["frame"], lambda planes: np.moveaxis(planes.numpy(), 0, -1)
        errors = [frame.rel_mse(last(sample["images"][k])) for k in range(len(names))] + [frame.rel_mse(last(image))]
        # The target's own noise, taken off on average, may be more than what is left.
        if min(errors) > frame.floor:
            rows.setdefault(sample["spp"], []).append(errors)
        true = (image - sample["target"]) ** 2 - torch.from_numpy(np.moveaxis(0.25 * frame.difference ** 2, -1, 0))
        relative = 1 / sample["divisor"]
        calibration.append((float((true.mean(0) * relative[0]).mean()), float((claimed * relative[0]).mean())))
    print("| spp | frames | " + " | ".join(name or "colours" for name in names) + " | blend | over the best | worst |\n" + "|---" * (len(names) + 5) + "|")
    good = bool(rows)
    for spp in sorted(rows):
        errors = np.array(rows[spp])
        means = np.exp(np.log(errors).mean(0))
        ratio = means[-1] / means[:-1].min()
        worst = (errors[:, -1] / errors[:, :-1].min(1)).max()
        good &= ratio < 1
        print("| %d | %d | %s | %.2f | %.2f |" % (spp, len(errors), " | ".join("%.5f" % m for m in means), ratio, worst))
    true, claimed = np.array(calibration).T
    print("true over claimed error: %.2f in the geometric mean" % np.exp(np.log(np.maximum(true, 1e-7) / claimed).mean()))
    return good


def test(options):
    compared(trained(options)[0], CANDIDATES[options.kind], samples(options.frames, options.kind)[1])


def export(options):
    """Writes half floats, and for the tests what the network makes of them on one crop."""
    (net, steps), (training, apart) = trained(options), samples(options.frames, options.kind)
    if not compared(net, CANDIDATES[options.kind], apart):
        raise SystemExit("not exported: a single image is better")
    net = net.half().float()
    top = os.path.join(os.path.dirname(__file__), "..", "..")
    named = {f"layer{k}.{key}": value.half() for k, layer in enumerate(layer for layer in net if hasattr(layer, "weight"))
             for key, value in layer.state_dict().items()}
    recipe = {"candidates": CANDIDATES[options.kind], "images": len(training), "steps": steps, "batch": BATCH, "crop": CROP,
              "rate": RATE, "seed": options.seed}
    save_file(named, os.path.join(top, "src/reconstruct/blend", options.kind + ".safetensors"),
              {"recipe": json.dumps(recipe)})
    given = apart[0]["features"][None, :, :12, :15]
    with torch.no_grad():
        made = torch.softmax(net(given), 1)
    vectors = {name: planes[0].permute(1, 2, 0).contiguous() for name, planes in (("input", given), ("output", made))}
    save_file(vectors, os.path.join(top, "tests/data", f"blend-{options.kind}.safetensors"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["train", "test", "export"])
    parser.add_argument("kind", choices=list(CANDIDATES))
    parser.add_argument("frames", nargs="+")
    parser.add_argument("--run", required=True)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    {"train": train, "test": test, "export": export}[options.action](options)
