// SPDX-License-Identifier: MIT
// The crossbar and the four quadrature decoders (ENC1..4).
#include "chip.h"
#include "core_pins.h"

IMXRT_ENC_t IMXRT_ENC1, IMXRT_ENC2, IMXRT_ENC3, IMXRT_ENC4;

extern "C" void xbar_connect(unsigned int input, unsigned int output);

namespace fake {
namespace {

constexpr uint32_t both_changed = 1u << 11;
// Pin, crossbar input, alternative function, daisy value (reference manual, IOMUXC).
constexpr uint8_t ways_in[][4] = {{0, 17, 1, 1},  {1, 16, 1, 0},  {2, 6, 3, 0},   {3, 7, 3, 0},
                                  {4, 8, 3, 0},   {5, 17, 3, 0},  {7, 15, 1, 1},  {8, 14, 1, 1},
                                  {30, 23, 1, 0}, {31, 22, 1, 0}, {32, 10, 1, 0}, {33, 9, 3, 0}};

struct Decoder {
    uint32_t position;
    uint16_t held_lower;
    bool phase[2];
};

Decoder decoders[4];
unsigned int source[88]; ///< crossbar input of each output

template <size_t unit>
uint32_t read_upper(uint32_t) {
    decoders[unit].held_lower = static_cast<uint16_t>(decoders[unit].position);
    return decoders[unit].position >> 16;
}

template <size_t unit>
uint32_t read_lower_hold(uint32_t) {
    return decoders[unit].held_lower;
}

template <size_t unit>
void write_upper(uint32_t value) {
    decoders[unit].position = (decoders[unit].position & 0xFFFFu) | value << 16;
}

template <size_t unit>
void write_lower(uint32_t value) {
    decoders[unit].position = (decoders[unit].position & 0xFFFF0000u) | value;
}

template <size_t unit>
void hook(IMXRT_ENC_t &registers) {
    registers.UPOS.on_read = read_upper<unit>;
    registers.UPOS.on_write = write_upper<unit>;
    registers.LPOS.on_write = write_lower<unit>;
    registers.LPOSH.on_read = read_lower_hold<unit>;
}

IMXRT_ENC_t *const units[] = {&IMXRT_ENC1, &IMXRT_ENC2, &IMXRT_ENC3, &IMXRT_ENC4};

template <size_t unit>
void write_control2(uint32_t value) {
    units[unit]->CTRL2.value =
        (units[unit]->CTRL2.value & ~(value & both_changed) & both_changed) | (value & ~both_changed);
}

void edge(size_t unit, size_t phase, bool high) {
    Decoder &decoder = decoders[unit];
    if (decoder.phase[phase] == high) {
        return;
    }
    decoder.phase[phase] = high;
    const bool other = decoder.phase[1 - phase];
    // A leads B: up. A changed: up if it now differs from B; B changed: up if it now equals A.
    const bool up = phase == 0 ? high != other : high == other;
    decoder.position += up ? 1u : 0xFFFFFFFFu;
}

} // namespace

void reset_decoders() {
    hook<0>(IMXRT_ENC1);
    hook<1>(IMXRT_ENC2);
    hook<2>(IMXRT_ENC3);
    hook<3>(IMXRT_ENC4);
    IMXRT_ENC1.CTRL2.on_write = write_control2<0>;
    IMXRT_ENC2.CTRL2.on_write = write_control2<1>;
    IMXRT_ENC3.CTRL2.on_write = write_control2<2>;
    IMXRT_ENC4.CTRL2.on_write = write_control2<3>;
    for (Decoder &decoder : decoders) {
        decoder = {0xDEAD'BEEF, 0, {true, true}};
    }
    for (unsigned int &input : source) {
        input = 0;
    }
    for (Register &each : daisy) {
        each.value = 9;
    }
}

void crossbar_edge(uint8_t pin, bool high) {
    for (const auto &way : ways_in) {
        const bool selected = way[1] == 10 || way[1] == 16 || daisy[way[1]].value == way[3];
        if (way[0] != pin || pins[pin].mux->value != way[2] || !selected) {
            continue;
        }
        for (size_t unit = 0; unit < 4; ++unit) {
            for (size_t phase = 0; phase < 2; ++phase) {
                if (source[XBARA1_OUT_ENC1_PHASEA_INPUT + 5 * unit + phase] == way[1]) {
                    edge(unit, phase, high);
                }
            }
        }
    }
}

void set_decoder(uint8_t unit, uint32_t position) {
    decoders[unit].position = position;
}

void report_both_changed(uint8_t unit) {
    units[unit]->CTRL2.value |= both_changed;
}

} // namespace fake

void xbar_connect(unsigned int input, unsigned int output) {
    fake::source[output] = input;
}
