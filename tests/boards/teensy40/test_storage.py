# SPDX-License-Identifier: MIT
"""Parameters in flash memory: whenever power fails, the old or the new set is there, and the next save works."""

from __future__ import annotations

import ctypes
import random
import struct
import zlib
from array import array

import pytest

from tests.parameter_sets import NOWHERE, drawn_values

OK, EMPTY = 0, 1
SECTORS, SECTOR_SIZE = 15, 4096
WORDS_OF_IMAGE, WORDS_OF_HEADER, WORDS_OF_MARK = 1024, 8, 4


class Store:
    """Parameter sets through ParamStore, FlashLog and the flash driver onto the model of the chip."""

    def __init__(self, chip: ctypes.CDLL) -> None:
        self.chip = chip
        self.count = int(chip.param_count())
        self.robot = array("f", [NOWHERE] * self.count)

    def values(self, seed: int) -> array[float]:
        """A parameter set in which every value differs from the robot's."""
        return array("f", drawn_values(seed))

    def few(self, seed: int) -> array[float]:
        values, drawn = array("f", self.robot), drawn_values(seed)
        for index in random.Random(seed).sample(range(self.count), 5):
            values[index] = drawn[index]
        return values

    def boot(self, running: bool = False) -> None:
        self.chip.storage_begin(running)

    def save(self, values: array[float]) -> int:
        return int(self.chip.param_save(self._pointer(values), self._pointer(self.robot)))

    def load(self) -> array[float]:
        values = array("f", self.robot)
        result = self.chip.param_load(self._pointer(values))
        assert result in (OK, EMPTY)
        return values

    @staticmethod
    def _pointer(values: array[float]) -> object:
        return (ctypes.c_float * len(values)).from_buffer(values)


@pytest.fixture
def store(chip: ctypes.CDLL) -> Store:
    store = Store(chip)
    store.boot()
    return store


def write_all(chip: ctypes.CDLL, seed: int) -> bytes:
    data = random.Random(seed).randbytes(chip.storage_size())
    assert chip.storage_write(0, data, len(data))
    return data


def read_all(chip: ctypes.CDLL) -> bytes:
    out = ctypes.create_string_buffer(chip.storage_size())
    assert chip.storage_read(0, out, len(out))
    return out.raw


def test_new_memory_reads_as_erased_and_has_no_parameters(chip: ctypes.CDLL, store: Store) -> None:
    assert read_all(chip) == b"\xff" * 2048
    assert store.load() == store.robot


def test_what_was_saved_is_there_after_a_reset(store: Store) -> None:
    for seed in range(1, 40):
        values = store.few(seed)
        assert store.save(values) == OK
        if seed % 3 == 0:
            store.boot()
        assert store.load() == values


def test_foreign_content_is_neither_taken_for_parameters_nor_erased_before_the_first_save(chip: ctypes.CDLL) -> None:
    chip.flash_reset(0x5A)
    store = Store(chip)
    store.boot()
    assert chip.flash_steps() == 0
    assert store.load() == store.robot
    assert store.save(store.few(1)) == OK
    store.boot()
    assert store.load() == store.few(1)


def test_a_memory_that_reads_as_erased_says_whether_it_may_hold_something(chip: ctypes.CDLL, store: Store) -> None:
    """New memory is not in doubt, other content is until a save has worked; so the robot comes up stopped."""
    assert not chip.storage_doubtful()
    chip.flash_reset(0x5A)
    store.boot()
    assert chip.storage_doubtful()
    assert store.save(store.few(1)) == OK
    assert not chip.storage_doubtful()
    store.boot()
    assert not chip.storage_doubtful()


def test_only_bytes_that_change_are_written(chip: ctypes.CDLL, store: Store) -> None:
    data = bytearray(write_all(chip, 1))
    before = chip.flash_steps()
    assert chip.storage_write(0, bytes(data), len(data))
    assert chip.flash_steps() == before
    data[1000] ^= 1
    assert chip.storage_write(0, bytes(data), len(data))
    assert chip.flash_steps() - before == 8  # two bytes each: the record's 8, and the 8 around the one that changed
    store.boot()
    assert read_all(chip) == bytes(data)


def test_the_first_bytes_of_an_empty_memory_are_kept_without_writing_its_ones(chip: ctypes.CDLL, store: Store) -> None:
    chip.flash_reset(0xFF)
    store.boot()
    assert chip.storage_write(1000, b"stop", 4)
    assert chip.flash_steps() == 16 + 8  # two bytes each: the 32 around the new ones, and the bank's header
    store.boot()
    assert read_all(chip) == (b"\xff" * 1000 + b"stop").ljust(2048, b"\xff")


def test_programming_any_length_anywhere_is_what_the_flash_controller_can_take(chip: ctypes.CDLL, store: Store) -> None:
    """The core's copy into the controller's registers faults if it stores a halfword at an odd address."""
    rng = random.Random(3)
    source = ctypes.create_string_buffer(rng.randbytes(128))
    memory = chip.flash_bytes()
    for length in range(1, 70):
        for offset in range(32):
            start = ctypes.addressof(source) + (offset + length) % 8  # every alignment of the source, too
            data = ctypes.string_at(start, length)
            chip.flash_reset(0xFF)
            chip.flash_program(3, offset, start, length)
            assert not chip.flash_misused(), f"{length} bytes at {offset}"
            sector = bytes(memory[3 * SECTOR_SIZE : 4 * SECTOR_SIZE])
            assert sector == (b"\xff" * offset + data).ljust(SECTOR_SIZE, b"\xff")


def test_programming_leaves_its_neighbours_alone(chip: ctypes.CDLL, store: Store) -> None:
    """Bytes beside the new ones may be programmed already: an older record that ends in the same unit."""
    rng = random.Random(4)
    for _ in range(500):
        chip.flash_reset(0xFF)
        model = bytearray(b"\xff" * SECTOR_SIZE)
        at = 0
        while at < 100:
            data = rng.randbytes(rng.randrange(1, 40))
            chip.flash_program(0, at, data, len(data))
            model[at : at + len(data)] = data
            at += len(data)
        assert bytes(chip.flash_bytes()[:SECTOR_SIZE]) == bytes(model)
        assert not chip.flash_misused()


@pytest.mark.parametrize("before", range(32))
def test_a_write_of_any_length_at_any_place_of_the_log_is_kept(chip: ctypes.CDLL, store: Store, before: int) -> None:
    """``before``: bytes of an earlier record, so that records begin everywhere that they can."""
    for length in range(1, 40):
        chip.flash_reset(0xFF)
        store.boot()
        model = bytearray(write_all(chip, 1))
        for offset, size in ((8, before), (1000 + length, length)):
            data = bytes(byte ^ 0xFF for byte in model[offset : offset + size])
            assert chip.storage_write(offset, data, size)
            model[offset : offset + size] = data
        assert not chip.flash_misused()
        store.boot()
        assert read_all(chip) == bytes(model)


def old_record(offset: int, data: bytes) -> bytes:
    """A record as every version so far has written it."""
    head = struct.pack("<HH", offset, len(data))
    return (head + struct.pack("<I", zlib.crc32(head + data)) + data).ljust(8 + (len(data) + 3) // 4 * 4, b"\xff")


def test_a_log_that_an_older_version_wrote_is_read_and_continued(chip: ctypes.CDLL, store: Store) -> None:
    """Its records are padded to four bytes, so the next one may begin in the middle of a unit."""
    rng = random.Random(5)
    for trial in range(50):
        chip.flash_reset(0xFF)
        store.boot()
        model = bytearray(write_all(chip, trial))
        at = 2064
        for _ in range(rng.randrange(1, 8)):
            offset, data = rng.randrange(1900), rng.randbytes(rng.randrange(1, 60))
            record = old_record(offset, data)
            ctypes.memmove(ctypes.addressof(chip.flash_bytes().contents) + at, record, len(record))
            at += len(record)
            model[offset : offset + len(data)] = data
        store.boot()
        assert read_all(chip) == bytes(model)
        for _ in range(3):
            offset, data = rng.randrange(1900), rng.randbytes(rng.randrange(1, 60))
            assert chip.storage_write(offset, data, len(data))
            model[offset : offset + len(data)] = data
        assert not chip.flash_misused()
        store.boot()
        assert read_all(chip) == bytes(model)


def test_writes_beyond_the_end_are_refused(chip: ctypes.CDLL, store: Store) -> None:
    size = chip.storage_size()
    for offset, length in ((size, 1), (size - 1, 2), (0, size + 1), (2**63, 1)):
        assert not chip.storage_write(offset, bytes(length), length)
        assert not chip.storage_read(offset, ctypes.create_string_buffer(length), length)
    assert chip.flash_steps() == 0


def test_random_writes_and_resets_keep_every_byte_and_spread_the_wear(chip: ctypes.CDLL, store: Store) -> None:
    rng = random.Random(7)
    model = bytearray(b"\xff" * 2048)
    for _ in range(3000):
        offset = rng.randrange(2048)
        data = rng.randbytes(rng.randrange(1, min(200, 2049 - offset)) if offset < 2047 else 1)
        assert chip.storage_write(offset, data, len(data))
        model[offset : offset + len(data)] = data
        if rng.random() < 0.02:
            store.boot()
        assert read_all(chip) == bytes(model)
    wear = [chip.flash_erases(sector) for sector in range(SECTORS)]
    assert max(wear) - min(wear) <= 2
    assert not chip.flash_misused()
    assert chip.flash_longest() <= 32  # interrupts are off for what is programmed at once


def test_sectors_are_erased_at_start_so_that_a_save_does_not_have_to(chip: ctypes.CDLL, store: Store) -> None:
    for seed in range(10):  # each fills a bank
        write_all(chip, seed)
        write_all(chip, seed + 100)
    store.boot(running=True)
    for seed in range(12):
        write_all(chip, seed + 200)
    assert chip.storage_late_erases() == 0


def fill_until_it_erases(chip: ctypes.CDLL, times: int = 1) -> None:
    seed = 0
    while chip.storage_late_erases() < times:
        write_all(chip, seed)
        seed += 1


def test_an_erase_while_the_robot_runs_gets_more_time_from_the_watchdog(chip: ctypes.CDLL, store: Store) -> None:
    chip.watchdog_start()
    store.boot(running=True)
    chip.fake_watchdog_elapse_ms(150)  # since it was fed last
    fill_until_it_erases(chip)
    journal = chip.fake_journal().decode()
    assert journal.replace("f", "") == "wwEw"  # started; longer before the erase, as before after it
    assert 150 <= chip.fake_watchdog_counts() / 32.768 <= 250
    assert not chip.fake_watchdog_bitten()
    assert not chip.fake_watchdog_misused()


def test_the_watchdog_is_as_short_as_before_and_not_run_out_after_an_erase(chip: ctypes.CDLL, store: Store) -> None:
    """400 ms have passed: a limit of 200 ms would be over as soon as it holds, unless the count begins anew before."""
    chip.watchdog_start()
    store.boot(running=True)
    fill_until_it_erases(chip, times=3)
    chip.fake_watchdog_elapse_ms(150)
    assert not chip.fake_watchdog_bitten()
    chip.fake_watchdog_elapse_ms(100)
    assert chip.fake_watchdog_bitten()


def test_a_ring_of_worn_sectors_does_not_trip_the_watchdog(chip: ctypes.CDLL, store: Store) -> None:
    """One erase after the other: the watchdog is set up again before the last set-up has arrived."""
    write_all(chip, 0)
    for sector in range(1, SECTORS):
        ctypes.memset(ctypes.addressof(chip.flash_bytes().contents) + sector * SECTOR_SIZE, 0, SECTOR_SIZE)
        chip.flash_wear_out(sector)
    store.boot(running=True)
    chip.watchdog_start()
    before = chip.fake_journal().count(b"E")
    data = random.Random(1).randbytes(chip.storage_size())
    assert not chip.storage_write(0, data, len(data))
    assert chip.fake_journal().count(b"E") - before >= SECTORS - 1
    assert not chip.fake_watchdog_bitten()
    assert not chip.fake_watchdog_misused()


def restore(store: Store, memory: bytes) -> None:
    ctypes.memmove(store.chip.flash_bytes(), memory, len(memory))
    store.boot()


def steps_of_save(store: Store, values: array[float]) -> int:
    """Return how many words and sectors a save would take, without leaving a trace."""
    memory = bytes(store.chip.flash_bytes()[: SECTORS * SECTOR_SIZE])
    before = int(store.chip.flash_steps())
    assert store.save(values) == OK
    steps = int(store.chip.flash_steps()) - before
    restore(store, memory)
    return steps


def cut_everywhere(store: Store, new: array[float], start: bool = False, dirty: int | None = None) -> int:
    """Save ``new`` over what is there, power failing at each step in turn. Return the number of cuts.

    ``start``: power may fail from the start of the processor on. ``dirty``: a sector that is not blank at the save.
    """
    chip = store.chip
    old = store.load()
    memory = bytes(chip.flash_bytes()[: SECTORS * SECTOR_SIZE])
    seen_old = seen_new = cuts = 0
    failed = True
    while failed:
        ctypes.memmove(chip.flash_bytes(), memory, len(memory))
        if not start:
            store.boot()
        if dirty is not None:
            chip.flash_bytes()[dirty * SECTOR_SIZE + 100] = 0x55
        chip.flash_cut_after(cuts, 7919 * cuts + 1)
        if start:
            store.boot()
        store.save(new)
        failed = chip.flash_power_on()
        store.boot()
        left = store.load()
        assert left in (old, new), f"a mix after a cut at step {cuts}"
        seen_old, seen_new = seen_old + (left == old), seen_new + (left == new)
        again = store.few(9999)
        assert store.save(again) == OK, f"the save after a cut at step {cuts}"
        store.boot()
        assert store.load() == again
        cuts += 1
    assert left == new  # the last run was not cut at all
    assert seen_old > 10
    assert seen_new >= 1
    return cuts - 1


@pytest.mark.parametrize("saves_before", [0, 3])
def test_a_power_cut_at_any_word_of_a_save_leaves_the_old_or_the_new_set(store: Store, saves_before: int) -> None:
    for seed in range(saves_before):
        assert store.save(store.few(seed + 1)) == OK
    assert store.save(store.few(11)) == OK
    cuts = cut_everywhere(store, store.few(12))
    assert cuts < WORDS_OF_IMAGE  # into the bank in use


def test_a_power_cut_at_any_word_of_a_save_of_everything(store: Store) -> None:
    everything, drawn = array("f", store.robot), drawn_values(1)
    for index in range(0, store.count, 2):
        everything[index] = drawn[index]
    assert store.save(store.few(11)) == OK
    assert cut_everywhere(store, everything) > store.count


def test_a_power_cut_at_any_word_of_a_write_leaves_all_or_nothing_of_it(chip: ctypes.CDLL, store: Store) -> None:
    old = write_all(chip, 1)
    memory = bytes(chip.flash_bytes()[: SECTORS * SECTOR_SIZE])
    data = random.Random(2).randbytes(101)
    new = old[:500] + data + old[601:]
    contents = set()
    for cut in range(60):
        restore(store, memory)
        chip.flash_cut_after(cut, 31 * cut)
        chip.storage_write(500, data, len(data))
        chip.flash_power_on()
        store.boot()
        contents.add(read_all(chip))
    assert contents == {old, new}


@pytest.mark.full
@pytest.mark.parametrize("dirty", [None, 1])
def test_a_power_cut_at_any_step_of_a_save_that_begins_a_bank(store: Store, dirty: int | None) -> None:
    new = store.few(12)
    seed = 0
    write_all(store.chip, seed)  # where nothing was ever written there is nothing to program
    assert store.save(store.few(seed)) == OK
    while steps_of_save(store, new) < WORDS_OF_IMAGE:
        seed += 1
        assert store.save(store.few(seed)) == OK
    erase = 0 if dirty is None else 1
    assert cut_everywhere(store, new, dirty=dirty) == WORDS_OF_MARK + WORDS_OF_IMAGE + WORDS_OF_HEADER + erase


def test_a_power_cut_at_any_step_of_the_erasing_at_start_loses_nothing(store: Store) -> None:
    for seed in range(1, 120):
        assert store.save(store.few(seed)) == OK
    erases = [store.chip.flash_erases(sector) for sector in range(SECTORS)]
    cut_everywhere(store, store.few(12), start=True)
    assert [store.chip.flash_erases(sector) for sector in range(SECTORS)] != erases


def test_a_worn_sector_is_left_out(chip: ctypes.CDLL, store: Store) -> None:
    first = write_all(chip, 1)
    for offset in range(SECTOR_SIZE):  # bits of the next sector that no erase sets any more
        chip.flash_bytes()[SECTOR_SIZE + offset] = 0
    chip.flash_wear_out(1)
    second = write_all(chip, 2)
    store.boot()
    assert read_all(chip) == second != first
