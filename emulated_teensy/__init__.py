# SPDX-License-Identifier: MIT
"""A Teensy 4.0 that runs the very image which is flashed; it knows no robot.

The processor is Unicorn's Cortex-M7. Interrupts, clocks, timers, flash memory, watchdog, pins and links of the i.MX
RT1062 are modelled in C (``src``). What is around the chip is a circuit of callbacks: pins, I2C buses, battery.
:mod:`hil_sim.teensy` wires a simulated robot to it.
"""
