"""Templates → one self-contained page. The only place that knows jinja2."""

import logging
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, TypeVar
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape

from discover import words
from discover._version import __version__
from discover.answer import Constant, law_in_words, sentences
from discover.answer import modes_in_words as modes
from discover.equations.markup import term_element
from discover.learners.registry import learner_title
from discover.protocols.kinematics import in_words
from discover.report import wording
from discover.report.mathtext import formula
from discover.report.plots.style import style_sheet
from discover.statistics.noise_model import rms

_CALCULATES = ("numpy", "scipy", "jax", "diffrax", "optimistix", "optax", "pysindy")


def made_by(fingerprint: str, command: str, files: tuple[str, ...], study_text: str) -> dict:
    """Return what a page says of the run that made it; every table links to it.

    `fingerprint`: of the study, its data and the version of this software. `command`: what makes it
    again. `files`: written with the page.
    """
    packages = [f"Python {platform.python_version()}"]
    for name in _CALCULATES:
        try:
            packages.append(f"{name} {version(name)}")
        except PackageNotFoundError:  # a copy that was not installed
            continue
    return {
        "id": fingerprint[:8],
        "fingerprint": fingerprint,
        "command": command,
        "packages": ", ".join(packages),
        "files": files,
        "study_text": study_text,
    }


# Characters of a file that a page carries; more would make the page slow to open
_MOST_INSIDE = 3_000_000


def render(template: str, data: Mapping[str, str] | None = None, **content: Any) -> str:
    """Return a page.

    Everything is escaped except pictures and mathematics that this package wrote itself.

    `data`: text of files that each picture links to, by name. The page carries those that are not
    too long, so that it hands them out where it stands alone; the others lie in its folder.
    """
    carried = {name: text for name, text in (data or {}).items() if len(text) <= _MOST_INSIDE}
    return (
        _environment()
        .get_template(template)
        .render(
            version=__version__,
            style_sheet=Markup(style_sheet()),
            data=data or {},
            carried=carried,
            **content,
        )
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("discover.report"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        percent=wording.percent,
        percent_range=wording.percent_range,
        significant=words.significant,
        interval=words.interval,
        estimate=words.estimate,
        constant=lambda one: Constant("", one.value, one.ci95),
        readable=words.readable,
        subscripts=wording.subscripts,
        explained=wording.explained,
        # a name of a file may break behind an underscore
        file_name=lambda text: Markup(str(escape(text)).replace("_", "_<wbr>")),
        safe_svg=Markup,
        as_link=lambda name: quote(os.fsencode(name)),  # be it UTF-8 or not
        in_units=wording.in_units,
        unbroken=wording.unbroken,
        in_cell=wording.in_cell,
        formula=formula,
        safe_name=safe_name,
        parameter_name=wording.parameter_name,
        effect_title=words.effect_title,
        effects_title=words.effects_title,
        rms=rms,
        term_element=term_element,
        learner_title=learner_title,
        quantities=in_words,
    )
    environment.globals.update(
        answer_sentences=sentences,
        law_in_words=law_in_words,
        modes=modes,
        symbols=words.FIGURE_SYMBOLS,
    )
    return environment


def safe_name(name: str) -> str:
    """Return a file name without anything that a file system could take amiss."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in name)[:100]


_log = logging.getLogger(__name__)
_LONGEST = 200

Part = TypeVar("Part")


@dataclass(frozen=True)
class Missing:
    """A part of a page that could not be drawn."""

    title: str  # the part, as the subject of a sentence
    reason: str  # what went wrong

    @property
    def sentence(self) -> str:
        """What the page says in place of the part."""
        return f"{self.title} could not be drawn: {self.reason}."


def attempt(title: str, draw: Callable[[], Part]) -> Part | Missing:
    """Return a part of a page, or what stands in its place where it cannot be drawn.

    A report comes after minutes or hours of computing, and its numbers lie in JSON already. No
    fault of one picture or table is worth the rest of the page. The logger of this module has the
    traceback, at level debug.
    """
    try:
        return draw()
    except Exception as error:
        _log.debug("%s could not be drawn", title, exc_info=True)
        text = " ".join(str(error).split())[:_LONGEST].rstrip(". ")
        return Missing(title, f"{type(error).__name__}, {text}" if text else type(error).__name__)


def batch_page(studies: Sequence[Any]) -> str:
    """Return the page over a batch: how each study ended (`discover.batch.status.StudyStatus`)."""
    return render(
        "batch.html",
        studies=studies,
        failed=[study for study in studies if study.status == "failed"],
        waiting=sum(study.status == "waiting" for study in studies),
    )
