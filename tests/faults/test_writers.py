# SPDX-License-Identifier: MIT
"""Every file of the user's is written by omniwheel.files or omniwheel.growing_file, and by nothing else."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("host", "emulated_teensy", "hil_sim", "image_check", "omni_reproduce", "bench")
WRITING = ("write_text", "write_bytes", "savefig", "tofile", "copyfile", "copy2")
INTO_A_FILE = ("save", "savez", "savez_compressed", "savetxt", "dump")
"""These take an open file, which ``files.replaced`` gives."""

ALLOWED = {
    "host/omniwheel/files.py": "the helper",
    "host/omniwheel/growing_file.py": "the helper for recordings",
    "host/omniwheel/firmware_child.py": "a temporary folder; an OSError is a FirmwareStartError",
    "host/omniwheel/history/robot_history.py": "append-only, all or nothing: tests/host/test_history.py",
    "host/omniwheel/hub/places.py": "locked, and believed only if it is whole: tests/hub/test_full_disk.py",
    "host/omniwheel/hub/shared_link.py": "a hub's log; without room for it there is none: tests/hub/test_full_disk.py",
    "host/omniwheel/storage_file.py": "opened to be locked; the firmware writes it",
    "hil_sim/studies/store.py": "append-only, with a checksum per record",
    "hil_sim/lanes/make_layout.py": "a step of the build",
    "bench/native_study.py": "a temporary folder",
    "bench/octave.py": "a temporary folder",
    "bench/ticks.py": "a temporary folder",
}


def writes(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and name of every call that opens a file for writing or writes one by name."""
    tree = ast.parse(source)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module == "omniwheel.files"]
    from_helper = {alias.name for node in imports for alias in node.names}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        of_helper = isinstance(node.func, ast.Name) and node.func.id in from_helper
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        owner = getattr(node.func.value, "id", "") if isinstance(node.func, ast.Attribute) else ""
        if not of_helper and _writes(node, name, owner):
            yield node.lineno, name


def _writes(node: ast.Call, name: str, owner: str) -> bool:
    if name == "open" and owner == "os":
        return "O_RDONLY" not in ast.dump(node)
    if name in ("open", "fdopen"):
        words = [
            word.value for word in (*node.args, *(k.value for k in node.keywords)) if isinstance(word, ast.Constant)
        ]
        modes = [word for word in words if isinstance(word, str) and 0 < len(word) <= 3 and set(word) <= set("rwaxbt+")]
        return any(set(mode) & set("wax+") for mode in modes)
    if name in INTO_A_FILE and owner in ("np", "json", "pickle"):
        return "'file'" not in ast.dump(node)
    return name in WRITING and owner != "files"


def test_nothing_else_writes_files() -> None:
    found = {}
    for path in sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")):
        calls = list(writes(path.read_text(encoding="utf-8")))
        if calls:
            found[str(path.relative_to(ROOT))] = calls
    assert {name: calls for name, calls in found.items() if name not in ALLOWED} == {}
    assert set(found) == set(ALLOWED), "an entry of ALLOWED that writes nothing any more"


def test_it_would_see_them() -> None:
    bad = (
        "path.open('w')",
        "open(name, mode='ab')",
        "path.write_text('x')",
        "figure.savefig(path)",
        "np.save(path, rows)",
        "json.dump(data, other)",
        "os.open(path, os.O_WRONLY)",
    )
    assert all(list(writes(line)) for line in bad)
    good = ("path.open()", "open(name, 'rb')", "files.write_text(path, 'x')", "np.save(file, rows)", "json.dumps(x)")
    assert not any(list(writes(line)) for line in good)
