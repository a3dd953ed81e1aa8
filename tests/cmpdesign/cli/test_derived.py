"""Commands that derive from calls: the same options, defaults and words, stated once."""

from __future__ import annotations

import inspect
from typing import Annotated, Any, TypedDict, Unpack, get_args, get_type_hints

import pytest
import typer
from typer.main import get_command

import cmpdesign
from cmpdesign.cli import app
from cmpdesign.cli.derived import derived
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs import options
from cmpdesign.inputs.options import Usual, options_of, settled
from cmpdesign.tracking.jobs.options import SequenceOptions, ShapeOptions, TrackOptions
from extractor import Extractor


def test_the_choices_are_the_extractors() -> None:
    taken = get_type_hints(Extractor.__init__)
    assert get_args(options.Preset) == get_args(taken["preset"])
    assert get_args(options.Side) == get_args(taken["side"])
    assert get_args(options.Channels) == get_args(taken["channels"])


@pytest.mark.parametrize(("name", "record"), [("track", TrackOptions), ("reconstruct", ShapeOptions)])
def test_a_command_has_the_options_of_its_call(name: str, record: Any) -> None:
    command = get_command(app).commands[name]  # type: ignore[attr-defined]
    call = getattr(cmpdesign, name)
    parameters = inspect.signature(call).parameters.values()
    arguments = {each.name for each in parameters if each.kind is each.POSITIONAL_OR_KEYWORD}
    own = {"recover", "as_json", "quiet", "verbose"}
    taken = {each.name: each for each in command.params if each.name not in own}
    assert set(taken) == arguments | {option.name for option in options_of(record)}
    for option in options_of(record):
        assert taken[option.name].default == option.usual.value
        assert taken[option.name].help[:1].strip()


@pytest.mark.parametrize(
    "words",
    [
        "build",
        "check",
        "dataset",
        "extract",
        "calibrate pattern",
        "calibrate rig",
        "export lerobot",
        "kerf",
        "render",
        "templates",
    ],
)
def test_a_command_has_the_parameters_and_defaults_of_its_call(words: str) -> None:
    command: Any = get_command(app)
    for word in words.split():
        command = command.commands[word]
    taken = {each.name: each for each in command.params}
    for each in inspect.signature(getattr(cmpdesign, words.replace(" ", "_"))).parameters.values():
        if each.kind is not each.VAR_KEYWORD and each.name != "output":
            assert taken[each.name].required == (each.default is each.empty), each.name
            if isinstance(each.default, int | float | str):
                assert taken[each.name].default == each.default


def test_every_command_that_ends_by_itself_is_a_call_of_its_name() -> None:
    found = set()
    for name, command in get_command(app).commands.items():  # type: ignore[attr-defined]
        names = getattr(command, "commands", {"": None})
        found |= {f"{name}_{sub}".strip("_") if name != "evaluate" else name for sub in names}
    assert found - {name for name in found if callable(getattr(cmpdesign, name, None))} == {
        "serve",
        "studio",
        "view",
    }


class More(TypedDict, total=False):
    """Options of the test.

    Keys:
        width_mm: width of the strip; None: that of the pad.
        times: how often; at least
            once.
    """

    width_mm: Annotated[float | None, Usual(None, metavar="MM", above=0)]
    times: Annotated[int, Usual(1, least=1, name="--repeat")]


def strip(pad: str, **how: Unpack[More]) -> dict[str, Any]:
    """Cut a strip, as the command ``strip`` does.

    Args:
        pad: name of the pad.
        how: see ``More``.
    """
    return {"pad": pad, **settled(More, how)}


def test_a_new_option_of_a_record_is_an_option_of_the_command() -> None:
    seen = []

    @derived(strip, "cutting")
    def command(found: dict[str, Any]) -> None:
        """More words."""
        seen.append(found)

    made = typer.Typer(rich_markup_mode=None)
    made.command()(command)
    one = get_command(made)
    help_text = one.get_help(typer.Context(one))
    assert "Cut a strip.\n\n  More words." in help_text
    assert "--repeat" in help_text and "[default: that of the pad]" in help_text
    one.main(["wide", "--repeat", "3", "--width-mm", "2.5"], standalone_mode=False)
    one.main(["usual"], standalone_mode=False)
    assert seen == [
        {"pad": "wide", "width_mm": 2.5, "times": 3},
        {"pad": "usual", "width_mm": None, "times": 1},
    ]


def test_options_are_checked_for_calls_and_commands_alike() -> None:
    with pytest.raises(CmpDesignError, match="width_mm is -1; expected a number above 0"):
        strip("a", width_mm=-1.0)
    with pytest.raises(CmpDesignError, match="times is 0; expected a number from 1"):
        strip("a", times=0)
    with pytest.raises(TypeError, match="speed is no option; there are width_mm, times"):
        strip("a", speed=2)  # type: ignore[call-arg]
    assert set(SequenceOptions.__annotations__) < set(TrackOptions.__annotations__)
