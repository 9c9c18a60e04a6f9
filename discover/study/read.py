"""Read a study file, with one clear error for whatever is wrong in it."""

import hashlib
import stat
import tomllib
from pathlib import Path

from pydantic import ValidationError

from discover import __version__
from discover.dataset.load import resolve_folder
from discover.dataset.table import read_bytes
from discover.errors import InputError
from discover.study.schema import Study

LARGEST_STUDY_FILE = 1_000_000
"""Bytes; a study is a page of text."""


def read_study(path: str | Path) -> Study:
    """Return the study in a TOML file.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, or holds an unknown key or a wrong value.
    """
    path = Path(path)
    text = _read_text(path)
    try:
        content = tomllib.loads(text)
    except RecursionError:
        raise InputError(
            f"{path} is nested too deeply to be a study file. Write it like those in studies/."
        ) from None
    except ValueError as error:  # TOML's own error, or a number of thousands of digits
        raise InputError(f"{path} is not valid TOML: {error}. Mend that line.") from None
    study = parse_study(content, str(path))
    study._path = path
    return study


def _read_text(path: Path) -> str:
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"{path} is a folder; give the study file, such as {path}/study.toml.")
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path} is a pipe or device; give a study file.")
        if status.st_size > LARGEST_STUDY_FILE:
            raise InputError(
                f"{path} is larger than a study file can be; is it a data file? Give a TOML file."
            )
        # editors on Windows write a byte order mark, which TOML does not know
        return path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError:
        raise InputError(f"There is no study file {path}. Check its path.") from None
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is not UTF-8 text, so it is not a study file. Save it as UTF-8."
        ) from None
    except OSError as error:
        raise InputError(
            f"{path} cannot be read: {error.strerror}. Check the file and who may read it."
        ) from None
    except InputError:
        raise
    except ValueError:
        raise InputError(f"{str(path)!r} is no name that a file can have. Correct it.") from None


def parse_study(content: dict, where: str = "the study") -> Study:
    """Return a study from nested dictionaries, as TOML gives them.

    Raises
    ------
    InputError
        If a key is unknown or a value is wrong; names the key.
    """
    try:
        return Study.model_validate(content)
    except ValidationError as error:
        raise InputError(_explain(error, where)) from None


_PLAIN = (
    ("valid tuple", "list in square brackets"),
    ("tuple", "the list"),
    ("valid dictionary or instance of ", "table, as in the section "),
    ("valid dictionary", "table"),
    ("number, unable to parse string as a number", "number"),
    ("integer, unable to parse string as an integer", "whole number"),
    (" after validation", ""),
)


def _explain(error: ValidationError, where: str) -> str:
    """Say the first thing that is wrong, and how many more there are."""
    problems = error.errors(include_url=False, include_context=False)
    # An unknown key explains most of what follows it
    problems.sort(key=lambda p: p["type"] != "extra_forbidden")
    places = [_place(p["loc"]) for p in problems]
    first, place = problems[0], places[0]
    if first["type"] == "extra_forbidden":
        section = _section(first["loc"][:-1])
        text = f"unknown key {place!r}. Known keys there are: {section}"
    elif first["type"] == "missing" and isinstance(first["loc"][-1], int):
        text = f"{_place(first['loc'][:-1])!r} needs more values than it has"
    elif first["type"] == "missing":
        text = f"{place!r} is missing"
    else:
        got = _shown(first.get("input"))
        # the branches of a union fail one by one; users see one key
        wishes = [_plain(p["msg"]) for p, at in zip(problems, places, strict=True) if at == place]
        wishes = [wishes[0], *(wish.removeprefix("should be ") for wish in wishes[1:])]
        text = f"{place or 'the file'}: {' or '.join(dict.fromkeys(wishes))}"
        if len(got) <= 80 and first["type"] != "value_error":
            text += f"; got {got}"
    more = len(set(places)) - 1
    tail = f" (and {more} more problem{'s' if more > 1 else ''} in this file)" if more else ""
    return f"{where}: {text}.{tail}"


def _shown(value: object) -> str:
    try:
        return repr(value)
    except ValueError:  # Python does not print integers of thousands of digits
        return "a number of thousands of digits"


def _plain(message: str) -> str:
    message = message.removeprefix("Value error, ").removeprefix("Input ")
    for technical, plain in _PLAIN:
        message = message.replace(technical, plain)
    return message[0].lower() + message[1:]


def _place(location: tuple) -> str:
    # pydantic adds the branch of a union to the place; users wrote only the keys
    return ".".join(str(part) for part in location if not _is_branch(part))


def _is_branch(part: object) -> bool:
    return isinstance(part, str) and (
        "[" in part or part in ("float", "int", "constrained-float", "str")
    )


def _section(location: tuple) -> str:
    model = Study
    for part in location:
        field = model.model_fields.get(str(part))
        if field is None:
            break
        inner = [
            a for a in (field.annotation, *getattr(field.annotation, "__args__", ()))
            if isinstance(a, type) and hasattr(a, "model_fields")
        ]  # fmt: skip
        if not inner:
            break
        model = inner[0]
    return ", ".join(model.model_fields)


def fingerprint(study: Study, *extra: object) -> str:
    """Return a hash of everything that decides a study's results.

    Used to tell whether a result folder belongs to this study: the study, the measured files it
    names, the version of this software, and what the caller adds (task, seed).

    Raises
    ------
    InputError
        If the data folder or a file in it cannot be read.
    """
    digest = hashlib.sha256(study.model_dump_json().encode())
    for item in (__version__, *extra):
        digest.update(f"|{item!r}".encode())
    if study.data.folder is not None:
        base = None if study.path is None else study.path.parent
        for path in sorted(resolve_folder(study.data.folder, base).glob("*.csv")):
            digest.update(path.name.encode("utf-8", "surrogateescape"))
            digest.update(read_bytes(path, path.name))
    return digest.hexdigest()[:16]
