"""A xacro expanded in a process of its own, within bounds of time and memory.

Run by its path, with the request as JSON on standard input; nothing of vftcli is loaded.
"""

import io
import json
import sys
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any


def refuse_variable(name: str) -> str:
    """Refuse a variable of the user's environment."""
    raise PermissionError(
        f"it reads the environment variable {name}, which may hold anything; write its value there"
    )


def expand(asked: Mapping[str, Any]) -> dict[str, Any]:
    """Text of the URDF, the files that were read, and why it failed."""
    import xacro
    from xacro import substitution_args
    from xacrodoc import packages

    packages.update_package_cache(asked["packages"])
    load, around = xacro.load_yaml, map(Path, asked["packages"].values())
    folders = [Path(asked["path"]).resolve().parent, *(folder.resolve() for folder in around)]

    def load_below(filename: str) -> Any:  # noqa: ANN401
        """What a file in these folders holds."""
        place = Path(xacro.abs_filename_spec(filename)).resolve()
        if not any(place.is_relative_to(folder) for folder in folders):
            raise PermissionError(
                f"it loads {filename}, which is outside of its folder and of the packages around "
                "it; copy that file beside it"
            )
        return load(filename)

    xacro.load_yaml = load_below
    xacro._global_symbols = xacro.create_global_symbols()
    substitution_args._eval_env = refuse_variable
    # The default of a variable, whatever the user's environment holds.
    substitution_args._eval_optenv = lambda _name, default="": default
    text = why = ""
    try:
        document = xacro.process_file(asked["path"], mappings=dict(asked["arguments"]))
        text = document.toxml()
    except Exception as error:  # noqa: BLE001 - a xacro is a program: it may raise anything
        why = " ".join(f"{type(error).__name__}: {error}".split())[:400]
    return {"text": text, "why": why, "files": list(dict.fromkeys(xacro.all_includes))}


def main() -> None:
    """Expand what standard input asks for to standard output."""
    asked = json.load(sys.stdin)
    seconds, memory = asked["seconds"], asked["memory"]
    with suppress(ImportError):  # Windows has no such limits
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    with redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
        made = expand(asked)
    json.dump(made, sys.stdout)


if __name__ == "__main__":
    main()
