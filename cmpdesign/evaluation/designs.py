"""``evaluate designs``: designs compared on one sensor, under its set of contacts: error, yield and cost."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from cmpdesign.design.design import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluation.precision import MEASURES
from cmpdesign.evaluation.report.statistics import round_for_json, sample_statistics
from cmpdesign.evaluation.runner import RunOptions, Trial, trial_rng
from cmpdesign.evaluation.simulated.contacts import ContactLoad, place_surface
from cmpdesign.evaluation.simulated.instrument import Instrument, instrument_for_design
from cmpdesign.evaluation.simulated.sensor import parse_sensor

CONTACT_REACH_MM = 4.0  # largest distance of a contact from the pattern's middle, in x and y


@dataclass(frozen=True)
class DesignEntry:
    """A compared design and its name."""

    name: str
    design: Design

    @property
    def text(self) -> str:
        """The design as canonical JSON."""
        return json.dumps(self.design.model_dump(mode="json"), sort_keys=True)


def design_entries(designs: Mapping[str, Design]) -> list[DesignEntry]:
    """The designs in the order given.

    Raises:
        CmpDesignError: there are no designs.
    """
    if not designs:
        raise CmpDesignError("no design to compare; give templates or TOML files")
    return [DesignEntry(name, design) for name, design in designs.items()]


def trials(options: RunOptions, designs: Sequence[DesignEntry]) -> list[Trial]:
    """The same number of positions and lights for every contact of the sensor's set and every design.

    Raises:
        CmpDesignError: the sensor has no contacts.
    """
    loads = parse_sensor(options.sensor_text).table.load
    if not loads:
        raise CmpDesignError("the sensor has no [[load]] table; give the contacts to compare designs with")
    return [
        Trial(f"{entry.name}-{load}-{i}", {**options.values, "design": entry.text, "load": load, "index": i})
        for entry in designs
        for load in range(len(loads))
        for i in range(options.trials)
    ]


@lru_cache(maxsize=8)
def _instrument(sensor_text: str, design_text: str, preset: str) -> Instrument:
    sensor, design = parse_sensor(sensor_text), Design.model_validate_json(design_text)
    return instrument_for_design(sensor, design, preset)  # type: ignore[arg-type]


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """The errors of one design under one contact; position and light are the same for all designs."""
    from cmpdesign.evaluation.measures.surface_errors import measure_reconstruction
    from cmpdesign.evaluation.simulated.conditions import sample_conditions

    instrument = _instrument(values["sensor"], values["design"], values["preset"])
    load = instrument.sensor.table.load[values["load"]]
    rng = trial_rng(values["seed"], f"load-{values['load']}", values["index"])
    x, y = rng.uniform(-CONTACT_REACH_MM, CONTACT_REACH_MM, 2)
    shear = (float(load.shear_mm[0]), float(load.shear_mm[1]))
    surface = place_surface(
        values["sensor"], ContactLoad(load.object, load.press_mm, shear, load.twist_deg), (float(x), float(y))
    )
    clean = instrument.sensor.table.conditions.model_copy(update={"specks": (0, 0)})
    conditions = sample_conditions(clean, rng, instrument.half_window_mm)
    return measure_reconstruction(instrument, surface, conditions, int(rng.integers(2**31)))


def figures(
    trials: Sequence[Trial], results: Sequence[Mapping[str, Any]], designs: Sequence[DesignEntry]
) -> dict[str, Any]:
    """The members of report.json: one entry per design."""
    document = {}
    for entry in designs:
        found = [r for t, r in zip(trials, results, strict=True) if t.values["design"] == entry.text]
        errors = {name: sample_statistics([result[name] for result in found]).to_json() for name in MEASURES}
        document[entry.name] = {**design_costs(entry.design), **errors}
    return {"designs": document}


def design_costs(design: Design) -> dict[str, Any]:
    """Properties and cost of a design: density, smallest feature, laser time."""
    from cmpdesign.layout.build import build_layout
    from cmpdesign.layout.measures import cell_areas_mm2, cell_widths_mm

    layout = build_layout(design)
    markers = int(layout.present.sum())
    return {
        "pattern": layout.pattern,
        "pitch_mm": round_for_json(float(layout.parameters["pitch_mm"])),
        "markers": markers,
        "markers_per_cm2": round_for_json(100 * markers / float(cell_areas_mm2(layout).sum()), 3),
        "smallest_feature_mm": round_for_json(float(cell_widths_mm(layout).min())),
        "laser_time_s": laser_time_s(design),
    }


def laser_time_s(design: Design) -> float | None:
    """Duration of the design's laser job with its machine and material; None if the job cannot be made."""
    from cmpdesign.errors import DesignError
    from cmpdesign.layout.build import build_layout
    from cmpdesign.products.laser.figures import pass_timing
    from cmpdesign.products.laser.job import make_job
    from cmpdesign.products.laser.setup import complete_setup

    try:
        job = make_job(design.name, build_layout(design), complete_setup(design.laser))
    except DesignError:
        return None
    return round_for_json(sum(pass_timing(job, laser_pass).time_s for laser_pass in job.passes), 3)
