"""A search that was interrupted goes on where it was: its state after each stage, as JSON.

Nothing in a search is random, so one that goes on from a stage ends where an undisturbed one does.
"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Protocol, runtime_checkable

import numpy as np

from discover.closed_loop.results.candidate_score import CandidateScore
from discover.closed_loop.search.seen_sets import SeenSets
from discover.closed_loop.search.state import SearchState
from discover.inference.by_mode.degrees import Degree
from discover.inference.least_squares import Fit


@runtime_checkable
class Store(Protocol):
    """Where finished parts of long work are kept; `discover.study.RunFolder` is one."""

    def load(self, part: str) -> dict[str, Any] | None:
        """Return a part, or None if it has to be computed."""
        ...

    def save(self, part: str, content: Mapping[str, Any]) -> None:
        """Keep a part."""
        ...


class SearchCheckpoint:
    """Keeps one search in a store.

    Parameters
    ----------
    store
        Where; None to keep nothing.
    name
        Of this search among others in the store.
    """

    def __init__(self, store: Store | None, name: str):
        self.store, self.name = store, name

    def save(self, search: SearchState) -> None:
        """Keep the state of a search between two stages."""
        if self.store is not None:
            self.store.save(self.name, _state(search))

    def restore(self, search: SearchState) -> bool:
        """Bring a search to the state that was kept, and return whether there was one."""
        state = self.store.load(self.name) if self.store is not None else None
        if state is None or state.get("model") != _model_of(search):
            return False
        _set(search, state)
        return True


def _model_of(search: SearchState) -> list[str]:
    """Return what the positions in a parameter vector mean."""
    return (
        [f"{name} by mode" for name in search.model.declared.by_mode]
        + [effect.name for effect in search.model.effects]
        + ["instant of a step"] * search.model.declared.step_instants
    )


def _state(search: SearchState) -> dict[str, Any]:
    fit = search.fit
    return {
        "model": _model_of(search),
        "fit": {
            "theta": fit.theta.tolist(),
            "free": [int(position) for position in fit.free],
            "residual": fit.residual.tolist(),
            "jacobian": fit.jacobian.tolist(),
        },
        "active": search.active,
        "settled": search.established,
        "rounds": search.rounds,
        "path": [np.asarray(theta).tolist() for theta in search.path],
        "rankings": [
            [asdict(score) | {"start": np.asarray(score.start).tolist()} for score in ranking]
            for ranking in search.rankings
        ],
        "aliases": search.aliases,
        "support": search.support,
        "left_out": search.left_out,
        "not_named": search.not_named,
        "refused": sorted(search.refused),
        "left_open": sorted(search.left_open),
        "unasked": sorted(search.without_aliases),
        "seen": search.seen.to_json(),
        "degrees": {name: asdict(found) for name, found in search.degrees.items()},
        "known": [[at, *pair] for at, pair in search.known.items()],
    }


def _set(search: SearchState, state: dict[str, Any]) -> None:
    fit = state["fit"]
    search.fit = Fit(
        np.array(fit["theta"]),
        tuple(fit["free"]),
        np.array(fit["residual"]),
        # no parameter is free where a law is declared whole: the shape would be lost
        np.array(fit["jacobian"]).reshape(len(fit["free"]), *np.shape(fit["residual"])),
    )
    search.active = list(state["active"])
    search.established = tuple(state["settled"])
    search.rounds = state["rounds"]
    search.path = [np.array(theta) for theta in state["path"]]
    search.rankings = [
        tuple(
            CandidateScore(
                **{**score, "aliases": tuple(score["aliases"]), "start": np.array(score["start"])}
            )
            for score in ranking
        )
        for ranking in state["rankings"]
    ]
    search.aliases = {name: tuple(others) for name, others in state["aliases"].items()}
    search.support = dict(state["support"])
    search.left_out = state["left_out"]
    search.not_named = dict(state.get("not_named", {}))
    search.refused = set(state.get("refused", ()))
    search.left_open = set(state.get("left_open", ()))
    search.without_aliases = set(state.get("unasked", ()))
    search.seen = SeenSets.from_json(state.get("seen", {}))
    search.degrees = {
        name: Degree(
            **{**found, "evidence": tuple(found["evidence"]), "own": tuple(found.get("own", ()))}
        )
        for name, found in state.get("degrees", {}).items()
    }
    search.known = {at: (mean, deviation) for at, mean, deviation in state["known"]}
