"""Training runs: steps that can be interrupted and resumed, with a log; a step is the same whenever it is taken."""
import argparse
import csv
import math
import os
import time

import numpy as np
import torch

# Ten scenes of every hundred are kept apart for tests.
APART = 9


def is_apart(name):
    return int(name) // 10 % 10 == APART


def arguments(parser, steps):
    """Options that every run has."""
    parser.add_argument("frames", nargs="+")
    parser.add_argument("--run", required=True)
    parser.add_argument("--steps", type=int, default=steps)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)


def command(description, steps, add_options=lambda parser: None, **actions):
    """Runs the action that the command line names, with the options of a run and those that are added."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=list(actions))
    arguments(parser, steps)
    add_options(parser)
    options = parser.parse_args()
    actions[options.action](options)


def state_path(folder):
    return os.path.join(folder, "state.pt")


def train(parts, step_of, options):
    """Calls `step_of(rng, step)`, which returns a number for the log, until all steps are done. `parts` are what a state consists
    of, by their names: networks, optimisers, schedules."""
    torch.set_num_threads(options.threads)
    os.makedirs(options.run, exist_ok=True)
    path, step = state_path(options.run), 0
    if os.path.exists(path):
        state = torch.load(path, map_location="cpu")
        step = state["step"]
        for name, part in parts.items():
            part.load_state_dict(state[name])
    print(f"from step {step}", flush=True)
    with open(os.path.join(options.run, "log.csv"), "a", newline="") as file:
        log, saved, values = csv.writer(file), time.time(), []
        while step < options.steps:
            values.append(step_of(np.random.default_rng([options.seed, step]), step))
            step += 1
            if step % 200 == 0:
                mean = np.mean([float(value) for value in values])
                log.writerow([step, "%.5f" % mean])
                file.flush()
                print(step, "%.4f" % mean, flush=True)
                values = []
            if time.time() - saved > 60 or step == options.steps:
                torch.save({"step": step, **{name: part.state_dict() for name, part in parts.items()}}, path + ".part")
                os.replace(path + ".part", path)
                saved = time.time()


def cosine(steps, first=500):
    """Factors of a learning rate that rises over the `first` steps and falls to zero at the last."""
    return lambda step: min(1.0, step / first) * 0.5 * (1 + math.cos(math.pi * min(1.0, step / steps)))


def descend(net, loss, rate, options, longest=None, factors=None):
    """Steps of Adam down `loss(rng)`, of a batch that it draws, by the one-cycle schedule or with `factors` of the rate by the
    step. Longer gradients than `longest` are cut to that length."""
    optimiser = torch.optim.Adam(net.parameters(), rate)
    schedules = torch.optim.lr_scheduler
    schedule = schedules.LambdaLR(optimiser, factors) if factors else schedules.OneCycleLR(optimiser, rate, options.steps)

    def step_of(rng, _):
        value = loss(rng)
        optimiser.zero_grad()
        value.backward()
        if longest:
            torch.nn.utils.clip_grad_norm_(net.parameters(), longest)
        optimiser.step()
        schedule.step()
        return value.detach()

    train({"net": net, "optimiser": optimiser, "schedule": schedule}, step_of, options)


def trained(net, options, name="net"):
    """The network of a run, and its number of steps."""
    state = torch.load(state_path(options.run), map_location="cpu")
    net.load_state_dict(state[name])
    return net, state["step"]
