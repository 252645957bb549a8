"""JavaScript in tests: V8 in this process (mini-racer), else Node, else a skip that says so."""

import json
import shutil
import subprocess
from functools import cache

import pytest


@cache
def _engine():
    try:
        from py_mini_racer import MiniRacer
    except ImportError:
        return shutil.which("node")
    return MiniRacer


class Script:
    """A script, to which questions are put as expressions; numbers that JSON lacks travel as strings."""

    def __init__(self, text: str) -> None:
        engine = _engine()
        if engine is None:
            pytest.skip("there is no JavaScript here: neither mini-racer (pip install mini-racer) nor node")
        self.text = f"{text}\n{_PLAIN}"
        self.context = None if isinstance(engine, str) else engine()
        if self.context is not None:
            self.context.eval(self.text)

    def __call__(self, expression: str, **given):
        values = json.dumps({name: _encoded(value) for name, value in given.items()})
        ask = f"JSON.stringify(_coded((({', '.join(given)}) => {expression})(...Object.values(_known({values})))))"
        if self.context is not None:
            return _decoded(json.loads(self.context.eval(ask)))
        run = subprocess.run(
            [_engine(), "-"],
            input=f"{self.text}\nprocess.stdout.write({ask})",
            capture_output=True,
            text=True,
            check=False,
        )
        assert run.returncode == 0, run.stderr
        return _decoded(json.loads(run.stdout))


_PLAIN = """
const _coded = (v) => typeof v === "number" && !Number.isFinite(v) ? "#" + v
  : Array.isArray(v) || ArrayBuffer.isView(v) ? Array.from(v, _coded)
  : v && typeof v === "object" ? Object.fromEntries(Object.entries(v).map(([k, x]) => [k, _coded(x)])) : v;
const _known = (v) => typeof v === "string" && v[0] === "#" ? Number(v.slice(1))
  : Array.isArray(v) ? v.map(_known)
  : v && typeof v === "object" ? Object.fromEntries(Object.entries(v).map(([k, x]) => [k, _known(x)])) : v;
"""


def _encoded(value):
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not -float("inf") < value < float("inf"):
        return "#NaN" if value != value else "#Infinity" if value > 0 else "#-Infinity"
    if isinstance(value, (list, tuple)):
        return [_encoded(one) for one in value]
    return {key: _encoded(one) for key, one in value.items()} if isinstance(value, dict) else value


def _decoded(value):
    if isinstance(value, str) and value.startswith("#"):
        return float(value[1:].replace("Infinity", "inf"))
    if isinstance(value, list):
        return [_decoded(one) for one in value]
    return {key: _decoded(one) for key, one in value.items()} if isinstance(value, dict) else value
