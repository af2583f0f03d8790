# SPDX-License-Identifier: MIT
"""What ``world.toml`` says about the simulated world: its numbers, plants and faults, with unit, range and meaning."""

from __future__ import annotations

from collections.abc import Mapping

from omni_schema.world import Quantity, WorldSchema, load_world
from omniwheel.paths import world_path

WORLD: WorldSchema = load_world(world_path())

WORLD_NUMBERS: Mapping[str, Quantity] = {
    name: quantity for name, quantity in WORLD.numbers.items() if quantity.in_scenario
}
"""Numbers allowed in a scenario's ``[world]``."""

WORLD_LISTS: Mapping[str, Quantity] = {
    name: quantity for name, quantity in WORLD.numbers.items() if quantity.list_in_scenario
}
"""Those allowed there of which each wheel has its own."""
