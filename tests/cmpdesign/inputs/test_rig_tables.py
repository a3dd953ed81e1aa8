"""A rig's reader passes over the tables of scenes and sensors, and over no other."""

from __future__ import annotations

import pytest

from cmpdesign.evaluation.simulated.sensor import SensorTable
from cmpdesign.scene.files.tables import SceneTables
from extractor import RigError, parse_rig
from tests.support.hostile.input_files import RIG

READ = {"view", "medium"}
BESIDE = {*SceneTables.model_fields, *SensorTable.model_fields} - READ


@pytest.mark.parametrize("name", sorted(BESIDE))
def test_tables_of_scenes_and_sensors_may_stand_beside(name: str) -> None:
    assert parse_rig(f"{name} = 1\n{RIG}").names == ("left",)


@pytest.mark.parametrize("name", sorted(BESIDE | READ))
def test_what_is_nearly_their_name_is_refused(name: str) -> None:
    with pytest.raises(RigError, match=rf"'{name}q' is unknown \(did you mean {name}\?\)"):
        parse_rig(f"{name}q = 1\n{RIG}")
