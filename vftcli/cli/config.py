"""Options in a TOML file: ``--config FILE``, or `vftcli.toml` in this folder.

Its values become words behind the typed ones, and are checked like these.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from contextvars import ContextVar
from importlib import import_module
from pathlib import Path
from typing import Any

import typer

from vftcli.cli.commands import now_of
from vftcli.cli.progress import echo
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import FILE, Choice, interval, settings_as_typed, settings_by_name
from vftcli.signals.parsing import did_you_mean, printable, shown, toml_file

NAME = "vftcli.toml"  #: The file that is read if it is in the working folder.
NONE = "none"  #: Value of ``--config`` for no file.
#: Options that are only typed: overwriting needs --force each time.
TYPED = frozenset({"config", "force", "help", "set"})
#: Command → options that only its own table gives.
OTHERWISE = {
    "identify": {"free", "gains"},
    "thresholds": {"reference", "reference-columns"},  # of --check alone
    "convert": {"log.derive"},  # it writes what was logged
}
Table = dict[str, Any]
Click = Any  #: A type of typer's own click, which has none.


#: The words of this call, with those of a file of options.
WORDS: ContextVar[Sequence[str]] = ContextVar("words", default=())
#: The file of options of this call, None without one.
READ: ContextVar[Path | None] = ContextVar("read", default=None)


def is_configured(command: Click) -> bool:
    """Whether a command has options from a file: those that read a log."""
    return any("--columns" in param.opts for param in command.params)


def kept_words(ctx: Click, args: Sequence[str]) -> tuple[Path, list[str]] | None:
    """The file of options beside these words, and its words; None without one.

    Options that are typed, or do not fit the logs, are left away.
    """
    command = ctx.command
    opts, _, params = command.make_parser(ctx).parse_args(list(args))
    named: str | None = opts.get("config")
    # Who writes such a file does not read it.
    writes = command.name == "inspect" and any(param.name == "output" for param in params)
    unread = named == NONE or (named is None and (writes or not Path(NAME).is_file()))
    if ctx.resilient_parsing or unread or "help" in opts:
        return None
    path = Path(named or NAME)
    given = [opts[param.name] for param in params if param.param_type_name == "argument"]
    logs = [Path(log) for one in given for log in words_in(one)]
    keys, typed = keys_for(command, path), [param.name for param in params]
    asked = [word.partition("=")[0].strip() for word in opts.get("set") or ()]
    words = [
        word
        for key, text in keys.items()
        if "." in key and key not in asked
        if any(kind.takes(key) for kind in choices_of(command))
        for word in ("--set", f"{key}={text}")
    ]
    for key, option in options_of(command).items():
        if key not in keys or option.name in typed:
            continue
        value = fitting(key, value_of(ctx, option, key, keys[key], path), logs)
        for one in value if isinstance(value, list) else [value]:
            if one is True:
                words.append(f"--{key}")
            elif one is not None:  # what begins with a dash follows =
                words += [f"--{key}={one}"] if one.startswith("-") else [f"--{key}", one]
    return path, words


def fitting(key: str, value: Any, logs: Sequence[Path]) -> Any:  # noqa: ANN401
    """A kept value for these logs, None if it is not for them.

    Columns are a log's, not those of estimates made from it; a log is no free run of itself.
    """
    if key == "columns":
        from vftcli.readers.references import stored_observers

        return None if any(map(stored_observers, logs)) else value
    if key == "free" and len(logs) == 1:
        own = logs[0].resolve()
        return [word for word in value if Path(word).resolve() != own] or None
    return value


def keys_for(command: Click, path: Path) -> Table:
    """Options of a file for a command: those on top, then the command's table.

    Settings have their dotted names, and their values are texts.
    """
    # A key that this command does not have may be another's.
    reading = {name: each for name, each in every_command().items() if is_configured(each)}
    known = {name: options_of(each) for name, each in reading.items()}
    choices = choices_of(*reading.values())
    every = {key for options in known.values() for key in options}
    top, own = Table(), Table()
    if not (path.is_file() or path.is_fifo()):
        raise ParameterError(
            f"--config {path}: no such file; vftcli inspect LOG -o FILE writes one"
        )
    for name, value in toml_file(path, "a file of options").items():
        if name not in known:
            top |= entry(path, name, value, every, "a command that reads a log", choices)
            continue
        if not isinstance(value, dict):
            raise ParameterError(f"{path}: {name} = {shown(value)} is no table of options")
        for key, given in value.items():
            # [contacts] is the command's table, and the group of contacts.list.
            if any(kind.takes(f"{name}.{key}") for kind in choices):
                top |= entry(path, name, {key: given}, every, "", choices)
            else:
                made = entry(path, key, given, known[name], name, choices)
                own |= made if name == command.name else {}
    others = OTHERWISE.get(command.name, set())
    return {key: value for key, value in top.items() if key not in others} | own


def entry(
    path: Path,
    key: str,
    value: Any,  # noqa: ANN401 - of TOML
    known: Collection[str],
    owner: str,
    choices: Sequence[type[Choice]],
) -> Table:
    """One key of a file as an option, or as settings by dotted names."""
    if key not in known and not isinstance(value, dict):
        key, value = key_now(path, key, value)
    if isinstance(value, dict):
        given = {f"{key}.{name}": one for name, one in value.items()}
        texts, own = settings_as_typed(given, choices, f"{path}: "), settings_by_name(choices)
        return {
            name: beside(path.parent, text, own[name][0]) if name in own else text
            for name, text in texts.items()
        }
    if key in TYPED:
        raise ParameterError(f"{path}: {key} is not kept in a file; type --{key}")
    if key not in known:
        near = did_you_mean(key, known) or " A key is an option without its dashes, as robot."
        raise ParameterError(f"{path}: {shown(key)} is no option of {owner}.{near}")
    return {key: value}


def key_now(path: Path, key: str, value: Any) -> tuple[str, Any]:  # noqa: ANN401 - of TOML
    """A former key as today's, with a note; others unchanged."""
    text = next(words_in(value), "")
    now = None if key in TYPED or isinstance(value, list) else now_of(f"--{key}", text)
    # An argument, of a command or of a xacro, has no key.
    if now is None or not now.startswith("--") or "'" in now or (not text and "VALUE" in now):
        return key, value
    echo(printable(f"note: {path}: {key} is now {now.replace('VALUE', '…')}"), err=True)
    option, _, form = now.removeprefix("--").partition(" ")
    if option == "set":
        name, _, form = form.partition("=")
        group, _, own = name.partition(".")
        return group, {} if value is False else {own: form.replace("VALUE", text)}
    return option, form.replace("VALUE", text) if form else value


def every_command() -> Mapping[str, Click]:
    """All commands by name, which loads them."""
    app = import_module("vftcli.cli").make_app()
    return dict(vars(typer.main.get_command(app))["commands"])


def choices_of(*commands: Click) -> tuple[type[Choice], ...]:
    """The choices of some commands, each once."""
    each = (kind for command in commands for kind in vars(command.callback)["choices"])
    return tuple(dict.fromkeys(each))


def options_of(command: Click) -> dict[str, Any]:
    """Option of a command by its key: its name without dashes."""
    options = (p for p in command.params if p.param_type_name == "option")
    every = {max(p.opts, key=len).lstrip("-"): p for p in options}
    return {key: p for key, p in every.items() if key not in TYPED}


def value_of(ctx: Click, option: Click, key: str, value: object, path: Path) -> Any:  # noqa: ANN401
    """A value for typer's option: words, True, or None of a flag."""
    if option.is_flag:
        if not isinstance(value, bool):
            raise ParameterError(f"{path}: {key} = {shown(value)} is neither true nor false")
        return value or None
    words = list(words_in(value))
    if not words or (len(words) > 1 and not option.multiple):
        several = (
            "a text, a number or a list of them" if option.multiple else "a text or a number"
        )
        raise ParameterError(f"{path}: {key} = {shown(value)} is not {several}")
    words = [beside(path.parent, word, option) for word in words]
    made = words if option.multiple else words[0]
    try:
        option.type_cast_value(ctx, made)
    except typer.BadParameter as error:
        raise ParameterError(f"{path}: {key} = {shown(value)}: {error.message}") from None
    return made


def words_in(value: object) -> Iterator[str]:
    """The words that would be typed for a value."""
    for word in value if isinstance(value, list | tuple) else [value]:
        if isinstance(word, bool) or not isinstance(word, str | int | float):
            return
        yield str(word)


def beside(folder: Path, word: str, option: Click) -> str:
    """A word; from the file's folder on if it names a file or folder."""
    prefix = FILE if word.startswith(FILE) else ""
    name = word.removeprefix(FILE)
    with suppress(ParameterError):
        interval(name)
        return word
    takes_file = any(kind in str(option.metavar) for kind in ("FILE", "LOG", "REF"))
    # A word without an ending is a name, unless it is a log.
    is_file = Path(name).suffix or len(Path(name).parts) > 1
    is_file = is_file or ("LOG" in str(option.metavar) and (folder / name).exists())
    return f"{prefix}{folder / name}" if takes_file and (prefix or is_file) else word
