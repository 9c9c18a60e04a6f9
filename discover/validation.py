"""What is wrong in nested values that a user wrote, in the user's words."""

from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from discover.errors import InputError
from discover.words import counted

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

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _lists(cls, content: Any) -> Any:
        # files know lists alone, and what is read is not to change
        if not isinstance(content, dict):
            return content
        return {key: _as_tuple(value) for key, value in content.items()}


def _as_tuple(value: Any) -> Any:
    return tuple(map(_as_tuple, value)) if isinstance(value, list) else value


def validated(model: type[_Model], content: object, where: str) -> _Model:
    """Return the model that nested dictionaries and lists hold.

    Parameters
    ----------
    model
        What is wanted.
    content
        As TOML and JSON give it.
    where
        The file, or the place in it, for messages.

    Raises
    ------
    InputError
        If a key is unknown or missing or a value is wrong; names the first, and counts the others.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise InputError(_explain(error, where, model)) from None


def _explain(error: ValidationError, where: str, model: type[BaseModel]) -> str:
    problems = error.errors(include_url=False, include_context=False)
    # an unknown key explains most of what follows it
    problems.sort(key=lambda problem: problem["type"] != "extra_forbidden")
    places = [_place(problem["loc"]) for problem in problems]
    first, place = problems[0], places[0]
    if first["type"] == "extra_forbidden":
        text = f"unknown key {place!r}. Known keys there are: {_keys(model, first['loc'][:-1])}"
    elif first["type"] == "missing" and isinstance(first["loc"][-1], int):
        text = f"{_place(first['loc'][:-1])!r} needs more values than it has; add them"
    elif first["type"] == "missing":
        text = f"{place!r} is missing; write it"
    else:
        # the branches of a union fail one by one; users see one key
        wishes = [_plain(p["msg"]) for p, at in zip(problems, places, strict=True) if at == place]
        wishes = [wishes[0], *(wish.removeprefix("should be ") for wish in wishes[1:])]
        text = f"{place or 'the file'}: {' or '.join(dict.fromkeys(wishes))}"
        got = _shown(first.get("input"))
        if len(got) <= _LONGEST and first["type"] != "value_error":
            text += f"; got {got}"
    more = len(set(places)) - 1
    tail = f" (and {counted(more, 'more problem')} in this file)" if more else ""
    return f"{where}: {text}.{tail}"


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
        "[" in part or part in ("float", "int", "constrained-float", "str")
    )


def _keys(model: type[BaseModel], location: tuple[Any, ...]) -> str:
    """Return the keys of the section at a place."""
    for part in location:
        field = model.model_fields.get(str(part))
        inner = [] if field is None else list(_models(field.annotation))
        if inner:
            model = inner[0]
    return ", ".join(field.alias or name for name, field in model.model_fields.items())


def _models(annotation: Any):
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)
