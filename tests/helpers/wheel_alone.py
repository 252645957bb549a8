"""The wheel in an empty environment, outside a checkout: examples copied, README's examples run.

python tests/helpers/wheel_alone.py [python3.12 ...]

A wheel is built, installed by pip with the versions of pins.txt, once for each interpreter named (this one unless
given), and README's Python is run as doctests beside the examples that the wheel brings.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]


def call(*command: object, folder: Path) -> str:
    """Output of a command that knows nothing of the checkout; its failure ends the program."""
    surroundings = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    done = subprocess.run(
        [str(word) for word in command], cwd=folder, env=surroundings | {"MPLBACKEND": "Agg"},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"{done.stdout}\nfailed with status {done.returncode}: {' '.join(map(str, command))}")
    return done.stdout


def try_with(python: str, wheel: Path, folder: Path) -> None:
    call(python, "-m", "venv", folder / "empty", folder=folder)
    scripts = folder / "empty" / ("Scripts" if os.name == "nt" else "bin")
    pip = ("-m", "pip", "--disable-pip-version-check", "install", "--quiet", "-c", ROOT / "pins.txt")
    call(scripts / "python", *pip, wheel, folder=folder)
    copied = call(scripts / "steadyslip", "examples", "-o", "examples", folder=folder).count("wrote ")
    verdict = call(scripts / "steadyslip", "analyze", "examples/inclined-spring.toml", folder=folder)
    (folder / "README.md").write_bytes((ROOT / "README.md").read_bytes())
    options = ("-o", "ELLIPSIS", "-o", "NORMALIZE_WHITESPACE")
    told = call(scripts / "python", "-m", "doctest", "-v", *options, "README.md", folder=folder)
    tried = next(line for line in told.splitlines() if line.endswith("passed.") or " passed and " in line)
    version = call(python, "--version", folder=folder).strip()
    print(f"{version}: {copied} examples copied; {tried}; {verdict.splitlines()[0]}", flush=True)


def main(pythons: list[str]) -> None:
    with tempfile.TemporaryDirectory() as made:
        call(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", made, folder=ROOT)
        (wheel,) = Path(made).glob("*.whl")
        for i, python in enumerate(pythons):
            folder = Path(made, str(i))
            folder.mkdir()
            try_with(python, wheel, folder)


if __name__ == "__main__":
    main(sys.argv[1:] or [sys.executable])
