"""Markdown tables of runs. Only Python's own library is needed, since tests print them, too."""
import math
import statistics

# Keys of the four measures, and their names.
MEASURES = {"relmse": "relMSE", "smape": "SMAPE", "flip": "FLIP", "dissimilarity": "1 - MS-SSIM"}
# Reference noise above this share of a scene's smallest relMSE shows in the other measures, from which it cannot be taken off.
CLEAN = 0.1
# The share of a reference's noise that is still there after it has been taken off relMSE: how well that noise is known.
KNOWN = 0.05
# Ratios are of errors that are at least this share of the reference's noise: of relMSE after it was taken off.
USABLE = 0.5


def table(specification, runs):
    """A table by its form."""
    return FORMS[specification["form"]](specification, runs)


def markdown(header, rows):
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def unique(values):
    return list(dict.fromkeys(values))


def geometric(values):
    return math.exp(statistics.fmean(map(math.log, values)))


class Errors:
    """Means over seeds by budget, scene and candidate; relMSE with the reference's own noise taken off."""

    def __init__(self, runs, candidate):
        self.of, collected = {}, {}
        for run in runs:
            key = run["budget"], run["scene"], candidate(run)
            collected.setdefault(key, []).append(run)
        for key, same in collected.items():
            means = {name: statistics.fmean(run[name] for run in same) for name in (*MEASURES, "spp", "floor")}
            means["relmse"] = max(means["relmse"] - means["floor"], KNOWN * means["floor"])
            self.of[key] = means
        self.budgets = unique(budget for budget, _, _ in self.of)
        self.scenes = unique(scene for _, scene, _ in self.of)

    def clean(self, budget, scene):
        """Whether the scene's reference is good enough for measures that its noise cannot be taken off."""
        here = [values for (b, s, _), values in self.of.items() if (b, s) == (budget, scene)]
        return here[0]["floor"] <= CLEAN * min(values["relmse"] for values in here)

    def usable(self, budget, scene, candidates):
        """Whether ratios of errors mean something on a scene."""
        here = [self.of[budget, scene, candidate] for candidate in candidates]
        return all(values["relmse"] >= USABLE * values["floor"] for values in here)

    def has(self, budget, scene, *candidates):
        return all((budget, scene, candidate) in self.of for candidate in candidates)


def candidate_of(specification):
    keys = specification.get("candidate", ["method"])
    return lambda run: ", ".join(str(run[key]) for key in keys if run[key] != "")


def ratios(specification, runs):
    """Geometric means over scenes of errors over those of a baseline, and the worst scene."""
    errors, baseline = Errors(runs, candidate_of(specification)), specification["baseline"]
    candidates = specification.get("candidates") or unique(map(candidate_of(specification), runs))
    header = ["budget", "candidate"] + [name for measure in MEASURES.values() for name in (measure, "worst")] + ["better in", "samples"]
    rows = []
    for budget in specification.get("budgets", errors.budgets):
        scenes = [scene for scene in errors.scenes if errors.has(budget, scene, baseline, *candidates)]
        counted = [scene for scene in scenes if errors.usable(budget, scene, [*candidates, baseline])]
        noisy = not all(errors.clean(budget, scene) for scene in counted)
        for number, candidate in enumerate(candidates):
            cells, better = [], 0
            for measure in MEASURES:
                of = [errors.of[budget, scene, candidate][measure] / errors.of[budget, scene, baseline][measure] for scene in counted]
                shown = "(%.2f)" if noisy and measure != "relmse" else "%.2f"
                cells += [shown % geometric(of), shown % max(of)] if of else ["-", "-"]
                better += bool(of) and geometric(of) < 1
            spp = "%.0f" % geometric(errors.of[budget, scene, candidate]["spp"] for scene in scenes) if scenes else "-"
            label = "%s (%d scenes)" % (budget, len(counted)) if number == 0 else ""
            rows.append([label, "`%s`" % candidate, *cells, "-" if candidate == baseline or not counted else "%d of 4" % better, spp])
    return markdown(header, rows)


def scenes(specification, runs):
    """The four errors of every scene by some candidates, and the floor of its reference."""
    errors, candidates = Errors(runs, candidate_of(specification)), specification["candidates"]
    header = ["budget", "scene", *("`%s`" % candidate for candidate in candidates), "floor"]
    rows = []
    for budget in specification.get("budgets", errors.budgets):
        for scene in errors.scenes:
            if not errors.has(budget, scene, *candidates):
                continue
            cells = [four(errors.of[budget, scene, candidate], errors.clean(budget, scene)) for candidate in candidates]
            rows.append([budget, scene, *cells, "%.1e" % errors.of[budget, scene, candidates[0]]["floor"]])
    return markdown(header, rows)


def four(values, clean):
    """The numbers of an image; those that the reference's noise is part of in parentheses."""
    relmse, *others = (values[measure] for measure in MEASURES)
    others = " ".join("%.3f" % value for value in others)
    return "%.1e %s" % (relmse, others if clean else "(%s)" % others)


def rows(specification, runs):
    """A row for each value of a key, a column for each other key or quotient of two; medians or means of all its runs."""
    key, columns = specification["key"], specification["columns"]
    combine = {"median": statistics.median, "mean": statistics.fmean, "first": lambda values: values[0]}[specification.get("combine", "median")]
    groups = {name: [run for run in runs if run[key] == name] for name in unique(run[key] for run in runs)}
    lines = [[str(name)] + [show(column, same, combine) for column in columns] for name, same in groups.items()]
    if "mean_of" in specification:
        mean = lambda column: column["format"] % geometric(amount(column["value"], same, combine) for same in groups.values())
        lines.append(["geometric mean", *(mean(column) if column["name"] in specification["mean_of"] else "" for column in columns)])
    return markdown([key, *(column["name"] for column in columns)], lines)


SIGNS = {" / ": lambda a, b: a / b, " - ": lambda a, b: a - b}


def amount(value, same, combine):
    """The value of an expression such as `a`, `a / b` or `a - b`."""
    for sign, joined in SIGNS.items():
        if sign in value:
            return joined(*(amount(part, same, combine) for part in value.split(sign)))
    return combine([run[value] for run in same])


def show(column, same, combine):
    if column["value"] not in same[0]:
        if any(sign in column["value"] for sign in SIGNS):
            return column["format"] % amount(column["value"], same, combine)
        return "-"
    first = same[0][column["value"]]
    if isinstance(first, list):
        return " ".join(column["format"] % value for value in first)
    if isinstance(first, str) or first is None:
        return first or "-"
    return column["format"] % amount(column["value"], same, combine)


FORMS = {"ratios": ratios, "scenes": scenes, "rows": rows}
