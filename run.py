#!/usr/bin/env python3
"""Set up and run steadyslip from a checkout; needs Python 3.11 or later with pip, nothing else.

    python3 run.py analyze examples/inclined-spring.toml   any steadyslip command
    python3 run.py test                                    the tests
    python3 run.py test --oldest                           the mechanics with the oldest supported versions
    python3 run.py docs                                    the site, into build/site
    python3 run.py build                                   source distribution and wheel, into dist
    python3 run.py check                                   lint, format, types, import layers

The first call makes a virtual environment in .venv beside this file and installs the pinned versions
of pins.txt there; later calls only run. The oldest versions, pins-oldest.txt, have .venv-oldest to themselves.
"""

import hashlib
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))


class Home:
    """A virtual environment beside this file, and the versions that it holds."""

    def __init__(self, name, pins):
        self.path = os.path.join(HERE, name)
        self.pins = os.path.join(HERE, pins)
        self.bin = os.path.join(self.path, "Scripts" if os.name == "nt" else "bin")
        self.python = os.path.join(self.bin, "python.exe" if os.name == "nt" else "python")


NEWEST = Home(".venv", "pins.txt")
OLDEST = Home(".venv-oldest", "pins-oldest.txt")

# The mechanics in full, which use formulas, numbers and kernels, and one route through each package besides.
OLDEST_TESTS = (
    "tests/linear",
    "tests/machine",
    "tests/model",
    "tests/motion",
    "tests/nonlinear",
    "tests/files/test_rig_files.py",
    "tests/figures",
    "tests/cli/test_command_line.py",
    "tests/experiments/test_fits.py",
    "tests/experiments/measured/test_records.py",
    "tests/maps/test_maps.py",
)
# Old packages warn of what newer ones around them deprecate; only with pins.txt a warning is an error.
OLDEST_OPTIONS = ("-o", "filterwarnings=default", "-p", "no:cacheprovider")
OLDEST_TIERS = ("-m", "not slow and not campaign")

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
    if command == "test" and "--oldest" in rest:
        install(OLDEST, "test-oldest")
        chosen = [word for word in rest if word != "--oldest"]
        named = any(os.path.exists(os.path.join(HERE, word.split("::")[0])) for word in chosen)
        chosen += () if named else (*OLDEST_TIERS, *OLDEST_TESTS)
        return call(OLDEST.python, "-m", "pytest", *OLDEST_OPTIONS, *chosen, folder=HERE)
    if command == "test":
        install(NEWEST, "test")
        return call(NEWEST.python, "-m", "pytest", *rest, folder=HERE)
    if command == "docs":
        install(NEWEST, "docs")
        return call(NEWEST.python, os.path.join(HERE, "docs", "site", "build.py"), *rest)
    if command == "build":
        install(NEWEST, "test")
        return call(NEWEST.python, "-m", "hatchling", "build", *rest, folder=HERE)
    if command == "check":
        install(NEWEST, "test")
        return max([call(os.path.join(NEWEST.bin, name), *options, folder=HERE) for name, *options in CHECKS])
    install(NEWEST)
    return call(NEWEST.python, "-m", "steadyslip", *arguments)


def install(home, extra=""):
    """Bring an environment up to date with pyproject.toml and its pins, for use or for tests as well."""
    state = hashlib.sha256()
    for name in (home.pins, os.path.join(HERE, "pyproject.toml")):
        with open(name, "rb") as file:
            state.update(file.read())
    for wanted in (extra,) if extra else ("use", "test"):  # an environment for tests serves for use too
        stamp = os.path.join(home.path, "installed-%s" % wanted)
        if os.path.exists(stamp) and open(stamp).read() == state.hexdigest():
            return
    print("setting up %s (once) ..." % os.path.basename(home.path), file=sys.stderr, flush=True)
    if not os.path.exists(home.python):
        # without pip: some systems ship Python without the module that puts pip into an environment
        require(sys.executable, "-m", "venv", "--without-pip", home.path)
    target = HERE + ("[%s]" % extra if extra else "")
    quiet = ("--quiet", "--disable-pip-version-check")
    require(sys.executable, "-m", "pip", "--python", home.python, "install", *quiet, "-c", home.pins, "-e", target)
    with open(os.path.join(home.path, "installed-%s" % (extra or "use")), "w") as file:
        file.write(state.hexdigest())


def call(*command, folder=None):
    # what Python makes of a checkout is kept in it: without that every process would make it anew
    surroundings = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.call(command, cwd=folder, env=surroundings)


def require(*command):
    """Run a step of the set-up; its output is kept for the case that it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        sys.exit("%s\nset-up failed: %s" % (done.stdout.rstrip(), " ".join(command)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
