# SPDX-License-Identifier: MIT
"""The programs in docs/report/host-control.md and docs/guides/mocap.md: the Arduino sketch and the bridge."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from omniwheel.host_control.pwm_line import parse_line

DOCS = Path(__file__).parents[3] / "docs"
STUBS = """
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>
enum { OUTPUT = 1 };
static unsigned long now_ms = 0;
static int pwm_out[14], dir_out[14];
static unsigned long millis() { return now_ms; }
static void pinMode(int, int) {}
static void digitalWrite(int pin, bool value) { dir_out[pin] = value ? 1 : -1; }
static void analogWrite(int pin, int value) { pwm_out[pin] = value; }
static struct {
    std::vector<char> input;
    void begin(long) {}
    int available() { return (int)input.size(); }
    int read() { char c = input.front(); input.erase(input.begin()); return (unsigned char)c; }
} Serial;
"""
MAIN = """
static void show() {
    for (int i = 0; i < 4; i++) std::printf("%d ", dir_out[DIR_PIN[i]] * pwm_out[PWM_PIN[i]]);
    std::printf("\\n");
}
int main() {
    setup();
    now_ms = 1000;
    for (int c; (c = std::getchar()) != EOF;) {
        Serial.input.push_back((char)c);
        loop();
    }
    show();
    now_ms += 300;
    loop();
    show();
}
"""


@pytest.fixture(scope="module")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sketch, compiled for this computer: prints the PWM after its input, and after 300 ms of silence."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    folder = tmp_path_factory.mktemp("sketch")
    code = re.search(r"```cpp\n(.*?)```", (DOCS / "report" / "host-control.md").read_text(encoding="utf-8"), re.DOTALL)
    assert code is not None
    source = folder / "sketch.cpp"
    source.write_text(STUBS + code[1] + MAIN, encoding="utf-8")
    subprocess.run([compiler, "-Wall", "-Werror", str(source), "-o", str(folder / "sketch")], check=True)
    return folder / "sketch"


def outputs(sketch: Path, data: bytes) -> list[tuple[int, ...]]:
    done = subprocess.run([str(sketch)], input=data, capture_output=True, check=True, timeout=20)
    return [tuple(int(word) for word in line.split()) for line in done.stdout.decode().splitlines()]


@pytest.mark.full
@given(st.lists(st.one_of(st.tuples(*[st.integers(-300, 300)] * 4), st.text("0123456789,-", max_size=30)), max_size=4))
@example(["0000001,2,3,4", "1,2,3,4000000000000000000000"])
@example(["1,2,3", "4,5,6,7", "9" * 30, "-1,-2,-3,-4"])
@settings(max_examples=50)
def test_the_sketch_takes_the_lines_that_are_lines(sketch: Path, parts: list[tuple[int, ...] | str]) -> None:
    texts = [part if isinstance(part, str) else ",".join(map(str, part)) for part in parts]
    expected: tuple[int, ...] = (0, 0, 0, 0)
    for text in texts:
        try:
            expected = parse_line(text.encode() + b"*")
        except ValueError:
            continue
    assert outputs(sketch, "".join(text + "*" for text in texts).encode()) == [expected, (0, 0, 0, 0)]


@pytest.mark.full
def test_the_documented_bridge_works(url: str) -> None:
    page = (DOCS / "guides" / "mocap.md").read_text(encoding="utf-8")
    printed = []
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        program = code.replace("tcp:127.0.0.1:5760", url)
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
        printed.append(done.stdout)
    _camera, bridge = printed
    mode, sent = bridge.split()
    assert mode == "hold"
    assert 3 <= int(sent) <= 12
