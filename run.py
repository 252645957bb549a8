#!/usr/bin/env python3
"""Set up and run steadyslip from a checkout; needs Python 3.11 or later with pip, nothing else.

    python3 run.py analyze examples/inclined-spring.toml   any steadyslip command
    python3 run.py test                                    the tests
    python3 run.py check                                   lint, format, types, import layers

The first call makes a virtual environment in .venv beside this file and installs the pinned versions
of pins.txt there; later calls only run.
"""

import hashlib
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
HOME = os.path.join(HERE, ".venv")
BIN = os.path.join(HOME, "Scripts" if os.name == "nt" else "bin")
PYTHON = os.path.join(BIN, "python.exe" if os.name == "nt" else "python")

CHECKS = (
    ("ruff", "check", "."),
    ("ruff", "format", "--check", "."),
    ("mypy",),
    ("lint-imports",),
)


def main(arguments):
    if sys.version_info < (3, 11):
        sys.exit("steadyslip needs Python 3.11 or later; this is %d.%d" % sys.version_info[:2])
    if not arguments:
        sys.exit(__doc__.strip())
    command, rest = arguments[0], arguments[1:]
    if command == "test":
        install("test")
        return call(PYTHON, "-m", "pytest", *rest, folder=HERE)
    if command == "check":
        install("test")
        return max([call(os.path.join(BIN, name), *options, folder=HERE) for name, *options in CHECKS])
    install()
    return call(PYTHON, "-m", "steadyslip", *arguments)


def install(extra=""):
    """Bring .venv up to date with pyproject.toml and pins.txt, for use or for tests as well."""
    pins = os.path.join(HERE, "pins.txt")
    state = hashlib.sha256()
    for name in (pins, os.path.join(HERE, "pyproject.toml")):
        with open(name, "rb") as file:
            state.update(file.read())
    for wanted in {extra, "test"}:  # an environment for tests serves for use too
        stamp = os.path.join(HOME, "installed-%s" % (wanted or "use"))
        if os.path.exists(stamp) and open(stamp).read() == state.hexdigest():
            return
    print("setting up .venv (once) ...", file=sys.stderr, flush=True)
    if not os.path.exists(PYTHON):
        # without pip: some systems ship Python without the module that puts pip into an environment
        require(sys.executable, "-m", "venv", "--without-pip", HOME)
    target = HERE + ("[%s]" % extra if extra else "")
    quiet = ("--quiet", "--disable-pip-version-check")
    require(sys.executable, "-m", "pip", "--python", PYTHON, "install", *quiet, "-c", pins, "-e", target)
    with open(os.path.join(HOME, "installed-%s" % (extra or "use")), "w") as file:
        file.write(state.hexdigest())


def call(*command, folder=None):
    return subprocess.call(command, cwd=folder)


def require(*command):
    """Run a step of the set-up; its output is kept for the case that it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        sys.exit("%s\nset-up failed: %s" % (done.stdout.rstrip(), " ".join(command)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
