"""Run docs/notebook.ipynb without Jupyter; as a command keep what its cells show.

VFT_LOGS=FOLDER python tests/run_notebook.py
"""

import ast
import io
import json
from base64 import b64encode
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebook.ipynb"
DPI = 100  # of a figure, which is about 700 points wide then


def code_cells(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def run_cells(notebook: dict[str, Any]) -> list[list[dict[str, Any]]]:
    """What each cell prints and shows, as a notebook keeps it."""
    names: dict[str, object] = {}
    found = []
    for number, cell in enumerate(code_cells(notebook), 1):
        body, value = ast.parse("".join(cell["source"])).body, None
        last = body.pop() if isinstance(body[-1], ast.Expr) else None
        with redirect_stdout(io.StringIO()) as printed:
            exec(compile(ast.Module(body, []), NOTEBOOK.name, "exec"), names)
            if last is not None:
                value = eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names)
        outputs: list[dict[str, Any]] = []
        if text := printed.getvalue():
            outputs.append({"output_type": "stream", "name": "stdout", "text": lines(text)})
        if value is not None:
            made = {"output_type": "execute_result", "execution_count": number, "metadata": {}}
            outputs.append({**made, "data": shown(value)})
        found.append(outputs)
    return found


def shown(value: Any) -> dict[str, Any]:
    """A value as text, and as a table or a picture where it makes one."""
    data = {"text/plain": lines(repr(value))}
    if hasattr(value, "savefig"):
        picture = io.BytesIO()
        value.savefig(picture, format="png", dpi=DPI)
        data["image/png"] = b64encode(picture.getvalue()).decode()
    elif hasattr(value, "_repr_html_"):
        data["text/html"] = lines(value._repr_html_())
    return data


def lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


if __name__ == "__main__":
    notebook = json.loads(NOTEBOOK.read_text("utf-8"))
    for number, (cell, outputs) in enumerate(
        zip(code_cells(notebook), run_cells(notebook), strict=True), 1
    ):
        cell |= {"execution_count": number, "outputs": outputs}
    text = json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
    NOTEBOOK.write_text(text, "utf-8")
