"""Pages that figures are printed on: docs/figures/NAME.md, which they own, and tables between marks on others.

    <!-- figure equal-samples.ratios -->
    <!-- end -->
"""
import os
import re

import figure
import tables
from scenes import ROOT

MARKS = re.compile(r"<!-- figure ([a-z0-9-]+)\.([a-z0-9-]+) -->\n.*?<!-- end -->", re.DOTALL)
BEGIN = "<!-- figure "
NEVER = "This figure has not been measured yet: `make figures NAME=%s` does."


def expected():
    """Paths of all pages with the text that they should have."""
    found = {os.path.join(figure.RESULTS, one.name + ".md"): page(one) for one in figure.every()}
    found[os.path.join(figure.RESULTS, "README.md")] = index()
    for path in documents():
        if path not in found:
            text = written(path)
            if len(MARKS.findall(text)) != text.count(BEGIN):
                raise SyntaxError("%s has a mark of a figure that is not written `%sNAME.TABLE -->`, or has no end" % (path, BEGIN))
            found[path] = MARKS.sub(lambda match: between(*match.groups()), text)
    return found


def documents():
    tops = [os.path.join(ROOT, name) for name in ("README.md", "python/README.md")]
    return tops + [os.path.join(folder, name) for folder, _, names in os.walk(os.path.join(ROOT, "docs")) for name in sorted(names)
                   if name.endswith(".md")]


def provenance(results):
    return "*%s, commit %s, %s.*" % (results["date"], results["commit"], results["machine"])


def between(name, which):
    """A table with its marks."""
    one = figure.Figure(name)
    results, specification = one.results(), one["tables"][which]
    content = NEVER % name if results is None else tables.table(specification, results["runs"]) + "\n\n" + provenance(results)
    return "<!-- figure %s.%s -->\n%s\n<!-- end -->" % (name, which, content)


def page(one):
    """All tables of a figure."""
    results = one.results()
    parts = ["# " + one["title"], one["text"].strip(), "Printed by `make figures NAME=%s`." % one.name]
    if results is None:
        parts.append(NEVER % one.name)
    else:
        parts[-1] += " " + provenance(results)
        for specification in one["tables"].values():
            parts += [specification["text"].strip(), tables.table(specification, results["runs"])]
    return "\n\n".join(parts) + "\n"


def index():
    lines = ["# Figures", "Every table is printed from the JSON file of the same name, which holds all runs, the commit, the date and the machine.",
             "\n".join("* [%s](%s.md)" % (one["title"], one.name) for one in figure.every()),
             "Two lists are printed by the program itself: [layers that files hold](layers.md) and [plugins of scene files](plugins.md)."]
    return "\n\n".join(lines) + "\n"


def outdated():
    """Paths of the pages whose text is not that of their figures, with the text that they should have."""
    return {path: text for path, text in expected().items() if text != written(path)}


def written(path):
    """The text of a page; None if there is none."""
    if not os.path.exists(path):
        return None
    with open(path) as file:
        return file.read()


def print_all():
    """Writes the pages that differ, and returns their names."""
    changed = outdated()
    for path, text in changed.items():
        with open(path, "w") as file:
            file.write(text)
    return names(changed)


def names(paths):
    return [os.path.relpath(path, ROOT) for path in paths]
