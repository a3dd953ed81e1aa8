"""The registry of patterns.

In: a pattern's name and a ``PatternShape``. Out: its graph and the positions of its markers for a pitch of one.
A module in this folder that calls ``register_pattern`` is tested, drawn and offered to users.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from runpy import run_path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.patterns.graphs import GraphFamily
from cmpdesign.patterns.numbering import Ints


@dataclass(frozen=True)
class PatternShape:
    """The parameters of a design that a pattern's positions depend on.

    Attributes:
        layers: the number of layers, 1 to 200.
        aspect: height over width (b / a), for patterns with this option.
        spacing: "angle" or "arc", for patterns with this option.
    """

    layers: int
    aspect: float = 1.0
    spacing: str = "angle"


# (layer, index, shape) -> (N, 2) positions for a pitch of one, origin at marker 0, y up.
PositionFunction = Callable[[Ints, Ints, PatternShape], NDArray[np.float64]]


@dataclass(frozen=True)
class Pattern:
    """A registered pattern.

    Attributes:
        name: the name in designs.
        graph: the family of graphs that the pattern embeds.
        positions: the function of marker positions.
        options: the fields of ``PatternShape`` that this pattern uses besides ``layers``.
    """

    name: str
    graph: GraphFamily
    positions: PositionFunction
    options: frozenset[str]

    @property
    def summary(self) -> str:
        """The first line of the pattern's docstring."""
        return (self.positions.__doc__ or "").strip().partition("\n")[0]


_PATTERNS: dict[str, Pattern] = {}


def register_pattern(
    name: str, graph: GraphFamily, options: tuple[str, ...] = ()
) -> Callable[[PositionFunction], PositionFunction]:
    """Decorate the function that returns a pattern's positions, and register the pattern.

    Raises:
        ValueError: the name is registered already.
    """

    def register(positions: PositionFunction) -> PositionFunction:
        if name in _PATTERNS:
            raise ValueError(f"the pattern {name!r} is registered twice")
        _PATTERNS[name] = Pattern(name, graph, positions, frozenset(options))
        return positions

    return register


def load_patterns(path: str) -> None:
    """Run a Python file that registers patterns, as ``--load`` does.

    Raises:
        CmpDesignError: the file cannot be run, or registers no pattern.
    """
    known = set(registered_patterns())
    try:
        run_path(path)
    except OSError as error:
        raise CmpDesignError(f"--load {path}: cannot be read ({error.strerror})") from None
    except Exception as error:
        raise CmpDesignError(f"--load {path}: {type(error).__name__}: {error}") from error
    if known == set(_PATTERNS):
        raise CmpDesignError(
            f"--load {path}: no pattern is registered; decorate a function with register_pattern"
        )
    registered_patterns.cache_clear()


@cache
def registered_patterns() -> Mapping[str, Pattern]:
    """Every registered pattern by name, in alphabetical order."""
    for module in pkgutil.iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")
    return MappingProxyType(dict(sorted(_PATTERNS.items())))
