"""Figures of the documents: measured by the program as it is, stored as JSON, and printed as tables.

    python3 tools/figures status                            which figures are stale, and how long they take
    python3 tools/figures check                             whether all pages have what the JSON files say
    python3 tools/figures print                             prints the pages anew
    python3 tools/figures references [--scenes FOLDER] [--hours 1]
    python3 tools/figures run [NAME ...] [--scenes FOLDER]  measures what is stale; what was interrupted goes on

Figures are specified by figures/NAME.toml; `measures/` has a file for each kind. The first three commands need nothing but Python 3.11, the
others the packages of requirements.txt and `cargo build --release`. Figures with times need a machine that does nothing else.
"""
import argparse
import os
import sys

sys.path.insert(1, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

import figure
import pages


def status(_):
    for one in figure.every():
        results, changed = one.results(), one.changed()
        minutes = one["minutes"] if results is None else results["minutes"]
        state = "never measured" if changed is None else "current" if not changed else "stale: " + ", ".join(changed)
        print("%-18s %6.1f min  %s" % (one.name, minutes, state))


def check(_):
    wrong = pages.names(pages.outdated())
    if wrong:
        sys.exit("%s: not what the figures say; `python3 tools/figures print` mends it" % ", ".join(wrong))
    other = [one.name for one in figure.every() if "run" in (one.changed() or [])]
    if other:
        sys.exit("%s: measured otherwise than figures/NAME.toml says; `make figures NAME=...` mends it" % ", ".join(other))


def print_pages(_):
    for name in pages.print_all():
        print(name)


def make_references(options):
    import references

    references.make(options.scenes, os.path.join(options.work, "references"), options.hours)


def run(options):
    import program
    import runner

    where = runner.context(options.scenes, options.work)
    known = {one.name: one for one in figure.every()}
    unknown = [name for name in options.names if name not in known]
    if unknown:
        sys.exit("there is no figure %s; there are %s" % (", ".join(unknown), ", ".join(known)))
    wanted = [known[name] for name in options.names] or [one for one in known.values() if one.changed() != []]
    failed = []
    for one in wanted:
        try:
            runner.run(one, where)
            pages.print_all()
        except program.Failed as error:
            failed.append(one.name)
            print("%s: %s" % (one.name, error), file=sys.stderr, flush=True)
    if failed:
        sys.exit("not measured: " + ", ".join(failed))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, action in (("status", status), ("check", check), ("print", print_pages), ("references", make_references), ("run", run)):
        command = commands.add_parser(name)
        command.set_defaults(action=action)
        if name in ("references", "run"):
            command.add_argument("--scenes", default="", help="folder of public scenes, as NAME/scene.xml")
            command.add_argument("--work", default="measured", help="folder of references and of unfinished figures")
        if name == "references":
            command.add_argument("--hours", type=float, default=1)
        if name == "run":
            command.add_argument("names", nargs="*")
    options = parser.parse_args()
    options.action(options)


if __name__ == "__main__":
    main()
