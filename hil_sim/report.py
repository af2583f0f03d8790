# SPDX-License-Identifier: MIT
"""Old place of ``hil_sim.run_picture``, for one more release."""

from omniwheel.moved import moved

_STYLE = ("GREY", "HEADING", "INK", "MARK", "STYLE", "TRUTH", "WANTED", "WHEEL_COLOURS")

__getattr__ = moved(
    __name__,
    {
        "draw_report": "hil_sim.run_picture:draw_run",
        **dict.fromkeys(("WIDTH_PX", "HEIGHT_PX", "DPI"), "hil_sim.run_picture"),
        **dict.fromkeys(_STYLE, "omniwheel.plot_style"),
    },
)
