"""What is wrong in nested values that a user wrote, in the user's words."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from discover.errors import InputError, Problems, problems_in
from discover.words import did_you_mean, nearest, unknown_name

_Model = TypeVar("_Model", bound=BaseModel)

_LONGEST = 80  # characters of a key or value that a message repeats

_PLAIN = (
    ("unable to parse input string as an integer, exceeded maximum size", "should be smaller"),
    (", unable to parse string as a number", ""),
    (", unable to parse string as an integer", ""),
    (", unable to interpret input", ""),
    ("valid tuple", "list in square brackets"),
    ("tuple", "the list"),
    ("valid dictionary or instance of ", "table, as in the section "),
    ("valid dictionary", "table"),
    ("object to be a list", "a list"),
    ("valid boolean", "true or false"),
    ("a true", "true"),
    ("valid integer", "whole number"),
    ("valid number", "number"),
    ("valid string", "text in quotes"),
    ("a text", "text"),
    ("section _", "section "),
    (" after validation", ""),
)
"""Words of pydantic and what users call it."""


class Section(BaseModel):
    """A table of a file that a user wrote: known keys alone, and every value of its own kind.

    A whole number does where a number is wanted. Nothing else is turned into something else: true
    is no 1, and "3" in quotes no 3.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, strict=True,
        use_attribute_docstrings=True,  # what a key means, as the page of all keys says
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _lists(cls, content: Any) -> Any:
        # files know lists alone, and what is read is not to change
        if not isinstance(content, dict):
            return content
        return {key: _as_tuple(value) for key, value in content.items()}


def _as_tuple(value: Any) -> Any:
    return tuple(map(_as_tuple, value)) if isinstance(value, list) else value


def one_of(kind: str, known: Callable[[], Iterable[str]]) -> Callable[[str], str]:
    """Return what checks that a name is known, and names the nearest where it is not."""

    def check(name: str) -> str:
        if name not in known():
            raise ValueError(unknown_name(kind, name, known()))
        return name

    return check


def validated(model: type[_Model], content: object, where: str) -> _Model:
    """Return the model that nested dictionaries and lists, of TOML or JSON, hold.

    Raises InputError, which names `where`, for all unknown or missing keys and wrong values.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise InputError(_explain(error, content, where, model)) from None


def _explain(error: ValidationError, content: object, where: str, model: type[BaseModel]) -> str:
    """Return all that is wrong, a line for each key; unknown keys first."""
    texts, at = [], _by_place(error)
    for place in [place for place, of in at.items() if of[0]["type"] == "extra_forbidden"]:
        *section, key = at[place][0]["loc"]
        known = _keys(model, tuple(section))
        near = nearest(key, known)
        guess = "" if near is None else f" Did you mean {near!r}?"
        texts.append(f"unknown key {place!r}.{guess} Known keys there are: {', '.join(known)}")
        content = _renamed(content, section, key, near)
    if texts:  # what else is wrong shows with these keys spelled rightly, or left out
        at = {}
        try:
            model.model_validate(content)
        except ValidationError as further:
            at = _by_place(further)
    for place, of in at.items():
        if of[0]["type"] != "extra_forbidden":
            texts += _of_value(place, of)
    problems = Problems()
    for text in texts:
        end = "" if text.endswith("?") else "."
        problems.add(f"{'' if len(texts) > 1 else f'{where}: '}{text.rstrip('.')}{end}")
    return problems.listed(where)


def _by_place(error: ValidationError) -> dict[str, list[Any]]:
    """Return what pydantic found, by place: branches of a union fail one by one, users see one."""
    at: dict[str, list[Any]] = {}
    for problem in error.errors(include_url=False):
        at.setdefault(_place(problem["loc"]), []).append(problem)
    return at


def _renamed(content: Any, section: Sequence[Any], key: Any, name: str | None) -> Any:
    """Return nested content with a key under another name, if that is free; else without it."""
    if section and isinstance(content, list | tuple) and isinstance(section[0], int):
        return [
            _renamed(part, section[1:], key, name) if i == section[0] else part
            for i, part in enumerate(content)
        ]
    if not isinstance(content, dict):
        return content
    if section:  # a part that is no key is the branch of a union
        first, *rest = section
        if first not in content:
            return _renamed(content, rest, key, name)
        return {**content, first: _renamed(content[first], rest, key, name)}
    left = {k: value for k, value in content.items() if k != key}
    return (
        left if name is None or name in left or key not in content else {**left, name: content[key]}
    )


def _of_value(place: str, problems: Sequence[Any]) -> list[str]:
    """Return what is wrong with the value of one key; of a section, of several of its keys."""
    first = problems[0]
    if first["type"] == "missing" and isinstance(first["loc"][-1], int):
        return [f"{_place(first['loc'][:-1])!r} needs more values than it has; add them"]
    if first["type"] == "missing":
        return [f"{place!r} is missing; write it"]
    where = place or "the file"
    several = problems_in(first["msg"])
    if len(several) > 1:
        return [f"{where}: {one}" for one in several]
    wishes = [_plain(problem["msg"]) for problem in problems]
    wishes = [wishes[0], *(wish.removeprefix("should be ") for wish in wishes[1:])]
    text = f"{where}: {' or '.join(dict.fromkeys(wishes))}"
    got = first.get("input")
    if len(_shown(got)) <= _LONGEST and first["type"] != "value_error":
        text += f"; got {_shown(got)}"
    words = [
        word
        for problem in problems
        if problem["type"] == "literal_error"
        for word in re.findall("'([^']*)'", problem["ctx"]["expected"])
    ]
    if isinstance(got, str) and words:
        text += f".{did_you_mean(got, words)}"
    return [text]


def _shown(value: object) -> str:
    """Return a value as TOML spells it, about."""
    try:
        if isinstance(value, bool):
            return str(value).lower()
        if isinstance(value, tuple):
            return f"[{', '.join(map(_shown, value))}]"
        return repr(value)
    except ValueError:  # Python does not print integers of thousands of digits
        return "a number of thousands of digits"


def _plain(message: str) -> str:
    message = message.removeprefix("Value error, ").removeprefix("Input ")
    message = message[0].lower() + message[1:]
    for technical, plain in _PLAIN:
        message = message.replace(technical, plain)
    return message


def _place(location: tuple[Any, ...]) -> str:
    # pydantic adds the branch of a union to the place; users wrote only the keys
    place = ".".join(str(part) for part in location if not _is_branch(part))
    return place if len(place) <= _LONGEST else f"{place[:_LONGEST]}…"


def _is_branch(part: object) -> bool:
    return isinstance(part, str) and (
        "[" in part or part.removeprefix("constrained-") in ("float", "int", "str", "bool", "tuple")
    )


def _keys(model: type[BaseModel], location: tuple[Any, ...]) -> list[str]:
    """Return the keys of the section at a place."""
    for part in location:
        field = model.model_fields.get(str(part))
        inner = [] if field is None else list(_models(field.annotation))
        if inner:
            model = inner[0]
    return [field.alias or name for name, field in model.model_fields.items()]


def _models(annotation: Any):
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)


def require_new_name(name: str, known: Sequence[str], what: str) -> None:
    """Raise InputError unless a name may be registered: well formed, and not among `known`."""
    if not isinstance(name, str) or not name.isidentifier() or name != name.lower():
        raise InputError(
            f"The name of a {what} must be lower-case letters, digits and underscores; got "
            f"{name!r}. Write it like 'giesekus_mobility'."
        )
    if name in known:
        raise InputError(
            f"The {what} {name!r} is known already, and what was computed with it is kept under "
            "that name. Choose another name, or start Python anew."
        )
