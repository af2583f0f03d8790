# SPDX-License-Identifier: MIT
from __future__ import annotations

import pytest

from tests.boards.teensy40.platformio_module import load

budget = load("memory_budget")

SIZES = """\
firmware.elf  :
section             size         addr
.text.headers       5120   1610612736
.text.code          3768   1610617856
.text.progmem        264   1610621624
.text.itcm         {itcm}            0
.fini                  4        78720
.ARM.exidx             8        78724
.data              15040    536870912
.bss               {bss}    536885952
.bss.dma           12416    538968064
.text.csf           3572   1610715660
.debug_info       999999            0
Total             216414
"""


def test_sections_are_counted_in_the_memory_they_live_in() -> None:
    usage = budget.Usage.from_size_output(SIZES.format(itcm=78720, bss=66656))
    assert usage.flash == 5120 + 3768 + 264 + 78720 + 8 + 15040 + 3572
    assert usage.itcm == 78732
    assert usage.dtcm == 15040 + 66656
    assert usage.ram2 == 12416
    # 512 KB less three blocks of 32 KB for the code, less data.
    assert usage.stack == 13 * 32 * 1024 - usage.dtcm
    assert usage.within_budget()
    assert "BUDGET" not in budget.report(usage)


@pytest.mark.parametrize(("itcm", "bss", "named"), [(193 * 1024, 1000, "ITCM"), (1000, 150 * 1024, "DTCM")])
def test_a_memory_above_its_budget_is_named(itcm: int, bss: int, named: str) -> None:
    usage = budget.Usage.from_size_output(SIZES.format(itcm=itcm, bss=bss))
    assert not usage.within_budget()
    over = [line.split()[0] for line in budget.report(usage).splitlines() if "OVER BUDGET" in line]
    assert over == [named]


def test_a_program_of_another_processor_is_refused() -> None:
    with pytest.raises(ValueError, match=r"text\.itcm"):
        budget.Usage.from_size_output(".text 1000 0\n.data 10 0\n")


def test_a_controller_from_outside_the_tree_has_a_block_of_its_own() -> None:
    usage = budget.Usage.from_size_output(SIZES.format(itcm=193 * 1024, bss=1000))
    assert usage.within_budget(budget.CONTROLLER_CODE)
    assert "BUDGET" not in budget.report(usage, budget.CONTROLLER_CODE)
    usage = budget.Usage.from_size_output(SIZES.format(itcm=(192 + 33) * 1024, bss=1000))
    assert not usage.within_budget(budget.CONTROLLER_CODE)
