"""How much more force a large strain needs than the reader's linear theory.

A ball without friction presses a neo-Hookean layer, in round finite elements. The markers of a pad move as the layer
does, and as the same layer moves under the same tractions by linear theory. The reader reads both; the ratio of its
forces is the factor by which its normal force falls short, and all other errors of the reader cancel.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import bmat

from benchmarks.force.seen import Seen, seen_from
from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import Table
from benchmarks.large_strain import neo_hookean
from benchmarks.large_strain.neo_hookean import PRESS_STEP_MM, NeoHookeanLayer
from cmpdesign import build_layout
from cmpdesign.contact import Elastomer
from cmpdesign.contact.finite_block import make_gel
from cmpdesign.design.design import load_design
from extractor.contact import ContactReader, ForceModel

Array = NDArray[np.float64]
NEAR_MM = np.concatenate([np.linspace(0, 3.6, 25), np.linspace(3.6, 9, 13)[1:]])
PENALTY_PER_MODULUS = 600.0
# thickness, radius of the ball, presses in steps of 0.1 mm
PRESSES = ((4.0, 5.0, (5, 8, 11)), (4.0, 3.0, (4, 6, 8)), (4.0, 10.0, (4, 7)), (2.0, 5.0, (3, 5)))
DEPTHS_MM, MARGIN_MM = (0.5, 1.0), 6.0
OFF_CENTRE_MM, YOUNG_MPA = (0.2, 0.1), 0.3


class Pressed(NamedTuple):
    """One state: the force, and the displacement (2, N) in r and z at distances from the axis, of both theories."""

    press_mm: float
    force_n: float
    finite_mm: dict[float, Array]
    linear_mm: dict[float, Array]


def pressed_states(layer: NeoHookeanLayer, steps: tuple[int, ...], far_mm: Array) -> Iterator[Pressed]:
    """The layer at growing presses, in steps of ``PRESS_STEP_MM``."""
    n = layer.basis.N
    layer.penalty = PENALTY_PER_MODULUS * layer.elastomer.shear_mpa
    still = _linear_matrix(layer)
    upward = layer.basis.get_dofs().all(["u^2"])
    for step, at in zip(range(1, max(steps) + 1), layer.states(), strict=False):
        if step not in steps:
            continue
        touch = {"press": step * PRESS_STEP_MM, "penalty": layer.penalty, "radius": layer.radius_mm}
        push = -neo_hookean._pushing.assemble(layer.top, **touch, u=layer.top.interpolate(at[:n]))
        load = np.concatenate([push, np.zeros(layer.pressures.N)])
        linear = skfem.solve(*skfem.condense(still, load, D=layer.held))
        yield Pressed(
            step * PRESS_STEP_MM,
            float(-2 * np.pi * push[upward].sum()),
            *({depth: layer.displacement(x, far_mm, depth) for depth in DEPTHS_MM} for x in (at, linear)),
        )


def _linear_matrix(layer: NeoHookeanLayer) -> object:
    r = np.asarray(layer.basis.global_coordinates())[0]
    unit = np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, *r.shape))
    mu = layer.elastomer.shear_mpa
    # of linear elasticity: mu grad u : grad v + mu grad u : grad v^T, which the incompressible layer's p at rest gives
    state = {"f": unit, "g": unit, "j": np.ones_like(r), "p": np.full_like(r, mu), "mu": mu}
    stiffness = neo_hookean._stiffness.assemble(layer.basis, **state)
    coupling = neo_hookean._coupling.assemble(layer.basis, layer.pressures, **state)
    return bmat([[stiffness, coupling.T], [coupling, None]], "csr")


def on_markers(xy_mm: Array, far_mm: Array, moved_mm: Array) -> Array:
    """(M, 3) mm of markers under a ball beside the centre."""
    offset = xy_mm - OFF_CENTRE_MM
    away = np.hypot(*offset.T)
    outward, up = (np.interp(away, far_mm, component) for component in moved_mm)
    return np.column_stack([offset / np.maximum(away, 1e-9)[:, None] * outward[:, None], up])


def measure(one_view: float | None = None, seed: int = 1) -> Shown:
    """One row for every state and depth of markers.

    Args:
        one_view: distance of a single camera, mm; two views without it.
    """
    random, far_mm = np.random.default_rng(seed), np.linspace(0.0, 16.0, 129)
    layout = build_layout(load_design("honeycomb", {"layers": "6", "pitch_mm": "1.5"}))
    readers: dict[tuple[float, float], Seen] = {}
    rows = []
    for thickness, radius, steps in PRESSES:
        layer = NeoHookeanLayer(Elastomer(thickness, YOUNG_MPA, 0.5, 0.5), radius, NEAR_MM)
        for state in pressed_states(layer, steps, far_mm):
            for depth in DEPTHS_MM:
                if (thickness, depth) not in readers:
                    gel = make_gel(layout, Elastomer(thickness, 1.0, 0.5, depth), margin_mm=MARGIN_MM)
                    linear = ContactReader(layout, gel, YOUNG_MPA, model=ForceModel(strain_factor=0.0))
                    readers[thickness, depth] = seen_from(linear, one_view)
                seen, read = readers[thickness, depth], []
                for moved in (state.finite_mm[depth], state.linear_mm[depth]):
                    seen.reader.reset()
                    read.append(seen.read(on_markers(layout.marker_xy_mm, far_mm, moved), random))
                area = read[0].regions[0].area_mm2
                ratios = -read[0].force_n[2] / (area * YOUNG_MPA), np.sqrt(area / np.pi) / thickness
                factor = read[1].force_n[2] / read[0].force_n[2]
                rows.append((thickness, radius, state.press_mm, depth, state.force_n, *ratios, factor))
    columns = {"thickness": "g", "ball": "g", "press": ".1f", "depth": "g", "force, N": ".3f"}
    columns |= {"read F / (A E)": ".3f", "radius / thickness": ".2f", "factor": ".4f"}
    yield Table("stiffening", columns, rows)


main = Experiment("force.stiffening", measure)
main.run_as(__name__)
