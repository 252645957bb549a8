"""Run the cells of a notebook without Jupyter, and write what they print and draw into it.

cd examples/notebooks; python ../../tests/helpers/notebooks.py *.ipynb
"""

import ast
import base64
import contextlib
import io
import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt

DPI = 60  # of pictures in notebooks, some 20 kB each


def cells_of(path: Path) -> list[dict]:
    return [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


def run_cell(source: str, names: dict) -> str:
    """What a cell prints, with its last expression as Jupyter shows it."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, "cell", "exec"), names)
        value = None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        if value is not None and not source.rstrip().endswith(";"):
            print(repr(value))
    return printed.getvalue()


def shown(cell: dict) -> str:
    """What a cell shows in the file."""
    return "".join("".join(one.get("text", "")) for one in cell["outputs"])


def drawn() -> list[dict]:
    """Output of a cell for each figure that it left open; they are closed."""
    found = []
    for number in plt.get_fignums():
        file = io.BytesIO()
        plt.figure(number).savefig(file, format="png", dpi=DPI, metadata={"Software": None})
        data = {"image/png": base64.b64encode(file.getvalue()).decode()}
        found.append({"data": data, "metadata": {}, "output_type": "display_data"})
    plt.close("all")
    return found


def main(paths: list[str]) -> None:
    for path in map(Path, paths):
        book = json.loads(path.read_text(encoding="utf-8"))
        names: dict = {}
        for number, cell in enumerate(cell for cell in book["cells"] if cell["cell_type"] == "code"):
            text = run_cell("".join(cell["source"]), names)
            stream = {"name": "stdout", "output_type": "stream", "text": text.splitlines(keepends=True)}
            cell["outputs"] = [*([stream] if text else []), *drawn()]
            cell["execution_count"] = number + 1
        path.write_text(json.dumps(book, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
