"""Digests of what figures depend on, by the table of modules in docs/design/architecture.md."""
import functools
import hashlib
import os
import re

from scenes import ROOT

ARCHITECTURE = os.path.join(ROOT, "docs", "design", "architecture.md")
ROW = re.compile(r"^\| `(src/[a-z_./]+)` \|.*\| ([a-z_, ]*)\|$", re.MULTILINE)
# What the safe wrappers wrap.
SHIMS = ["ffi", "build.rs"]
# Code, with the start of lines that say nothing to its compiler.
COMMENTS = {".rs": "//", ".h": "//", ".c": "//", ".cpp": "//", ".py": "#"}
IGNORED = (".md", ".pyc")


def all_below(roots):
    """Folders and files of some modules, and of all that they may use."""
    with open(ARCHITECTURE) as file:
        uses = {path: [name.strip() for name in names.split(",") if name.strip()] for path, names in ROW.findall(file.read())}
    by_name = {os.path.basename(path).removesuffix(".rs"): path for path in uses}
    found, waiting = [], list(roots)
    while waiting:
        path = waiting.pop()
        if path not in uses:
            raise KeyError("%s is no module of docs/design/architecture.md" % path)
        if path not in found:
            found.append(path)
            waiting += [by_name[name] for name in uses[path]]
    return sorted(found) + (SHIMS if "src/ffi" in found else [])


def of_text(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@functools.cache
def of_path(path):
    """Of a file or folder of the repository. Comments and empty lines of code do not count, nor do documents."""
    whole = hashlib.sha256()
    top = os.path.join(ROOT, path)
    if not os.path.exists(top):
        raise FileNotFoundError("there is no %s" % path)
    below = (os.path.join(folder, name) for folder, _, files in os.walk(top) for name in files)
    for name in [top] if os.path.isfile(top) else sorted(name for name in below if not name.endswith(IGNORED)):
        with open(name, "rb") as file:
            content = file.read()
        comment = COMMENTS.get(os.path.splitext(name)[1])
        if comment:
            lines = (line.strip() for line in content.decode().splitlines())
            content = "\n".join(line for line in lines if line and not line.startswith(comment)).encode()
        whole.update(os.path.relpath(name, ROOT).encode() + b"\0" + content + b"\0")
    return whole.hexdigest()[:16]
