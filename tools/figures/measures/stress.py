"""Every case of `fluxion stress`: the figure that comes nearest to its bound."""
import program

REFERENCES = False


def cells(run, where):
    names = [line.split()[0] for line in program.call("stress", "--list").splitlines() if "/" in line.split("  ")[0]]
    return [[name] for name in names]


def measure(cell, run, where, folder):
    # Exit code 1 says that a case has failed, which the table does, too.
    cases = program.with_statistics("stress", "--filter", cell[0], codes=(0, 1))
    return [entry(case) for case in cases if case["name"] == cell[0]]


def entry(case):
    """A case by the figure with the largest share of its bound; figures with the bound zero are counts of failures."""
    bounded = [one for one in case["list"] if one["bound"] > 0]
    worst = max(bounded or case["list"], key=lambda one: one["value"] / one["bound"] if one["bound"] else 0)
    return {"case": case["name"], "content": case["summary"], "figures": len(case["list"]),
            "failed": sum(one["value"] > one["bound"] for one in case["list"]),
            "worst": "%s: %.1e of %g (%s)" % (worst["subject"], worst["value"], worst["bound"], worst["measure"]),
            "seconds": case["seconds"]}
